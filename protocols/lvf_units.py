"""What the calibration of an LVF consists of besides darkness: a strip in several lights."""

from dataclasses import dataclass
from enum import StrEnum

from labrig.acquire import CAMERA, Session, Shoot, Timed, at

from .steps.arrangement import light
from .steps.camera_settings import MARGIN_S
from .steps.posing import charge, face_lamp, lights_out, seen_s
from .steps.scene_units import SceneUnit, frames_of


class LvfFrames(StrEnum):
    """The card; the strip looked through and on the sample; mercury lines there; their stripes."""

    CARD = "lvf-card"
    FILTER = "lvf-filter"
    STRIP_ON_SAMPLE = "lvf-strip-on-sample"
    LINES = "lvf-lines"
    LINES_ON_SAMPLE = "lvf-lines-on-sample"
    STRIPES = "lvf-stripes"


#: What the unit without a colour filter is called by.
NO_FILTER = "none"
#: Shutter times of the stripes' photographs, as shares of the longest.
STRIPES_LADDER = (1 / 512, 1 / 64, 1 / 8, 1)


def filter_unit(name: str | None) -> str:
    """Name of the unit of a colour filter."""
    return f"filter-{name or NO_FILTER}"


@dataclass(frozen=True)
class StripUnit(SceneUnit):
    """The strip under a halogen lamp, looked through or on the sample."""

    def check(self, session: Session) -> None:
        """It has to be seen, whole and straight."""
        session.choose("strip", lambda: self._strip(session), worst="found")

    def _strip(self, session: Session) -> str:
        # Takes a while to load, and plans do without.
        from .steps.strip_checks import strip_found

        return strip_found(self.own(session))


@dataclass(frozen=True)
class LinesUnit(SceneUnit):
    """The strip under a mercury lamp.

    Attributes
    ----------
    strip
        Purpose and unit of the strip under a halogen lamp.
    rising
        Whether wavelengths should rise from left to right.
    """

    strip: tuple[str, str] = ("", "")
    rising: bool | None = None

    def check(self, session: Session) -> None:
        """Its lines have to be seen, the right way round."""
        session.choose("mercury", lambda: self._lines(session), worst="lines found")

    def _lines(self, session: Session) -> str:
        from .steps.strip_checks import lines_found

        return lines_found(self.own(session), frames_of(session, *self.strip), self.rising)


@dataclass(frozen=True)
class FilterUnit(SceneUnit):
    """A colour filter, seen through the strip."""

    def check(self, session: Session) -> None:
        """Tell at once of a filter that seems not to be in its place."""
        if session.choose("like the picture before", lambda: self._same(session), worst=False):
            session.warn(
                f"the picture with the colour filter {self.wanted.filter} is like the one before "
                f"it ({self._unit_before}): take the last step back if the filter is not in its "
                "place; if it was not, the calibration does without it"
            )

    @property
    def _unit_before(self) -> str:
        return filter_unit(self.before.filter)

    def _same(self, session: Session) -> bool:
        from .steps.strip_checks import look_alike

        before = frames_of(session, self.purpose, self._unit_before)
        strip = frames_of(session, self.purpose, filter_unit(None))
        return look_alike(self.own(session), before, strip)


@dataclass(frozen=True)
class StripesUnit(SceneUnit):
    """The sample charged by mercury lines through the strip: where they glow, the map is pinned.

    Without a trap door the sample is seen where it lies.

    Attributes
    ----------
    charge_s
        For how long.
    """

    charge_s: float = 600.0

    def run(self, session: Session) -> None:
        """Charge, turn the sample to the camera, photograph with rising shutter times."""
        self.arrange(session)
        light(session, self.warm_up_s(session))
        charge(session, self.charge_s)
        offers, scene = session.rig[CAMERA].offers(), self.still_life
        at_s, steps = seen_s(session) + MARGIN_S, list[Timed]()
        for share in STRIPES_LADDER:
            exposure_s = offers.exposure_at_most(scene.longest_s * share)
            steps.append(at(at_s, Shoot(self.purpose, scene.settings(exposure_s))))
            at_s += exposure_s + offers.overhead_s + MARGIN_S
        session.run_sequence([*lights_out(session), *steps])
        face_lamp(session)
