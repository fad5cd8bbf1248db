"""The strip of the variable filter under a halogen lamp, as several protocols photograph it."""

from dataclasses import dataclass
from enum import StrEnum

from labrig.acquire import Session

from .scenes import SceneUnit


class LvfFrames(StrEnum):
    """Roles of frames of card, strip before camera and on sample, mercury lines and stripes."""

    CARD = "lvf-card"
    FILTER = "lvf-filter"
    STRIP_ON_SAMPLE = "lvf-strip-on-sample"
    LINES = "lvf-lines"
    LINES_ON_SAMPLE = "lvf-lines-on-sample"
    STRIPES = "lvf-stripes"


#: Name of the unit without a colour filter.
NO_FILTER = "none"


def filter_unit(name: str | None) -> str:
    """Return the name of the unit of a colour filter."""
    return f"filter-{name or NO_FILTER}"


@dataclass(frozen=True)
class StripUnit(SceneUnit):
    """The strip under a halogen lamp, before the camera or on the sample."""

    def check(self, session: Session) -> None:
        """Check that the strip is visible, whole and straight."""
        session.choose("strip", lambda: self._strip(session), worst="found")

    def _strip(self, session: Session) -> str:
        # Takes a while to load, and plans do without.
        from .strip_checks import strip_found

        return strip_found(self.own(session))
