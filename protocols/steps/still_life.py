"""Photographs of what stays the same: metered by a ladder of short ones, then as a bracket."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.acquire import CAMERA, CameraOffers, ExposureSettings, Session, Shoot
from labrig.errors import DeviceError
from labrig.quantity import duration_text
from labrig.record import FrameRecord, FrameRole
from labrig.reduce import measure, read_raw

from .camera_settings import DARKS_PER_EXPOSURE, CameraSettings
from .metering import SEEN_DN, SEEN_SIGMA, TARGET

#: Shutter times to look with, as shares of the longest.
LADDER = (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1)
#: A look that fills so much of the range is the last: its noise does not matter any more.
ENOUGH = 0.05
#: The second exposure of a bracket, for the dim parts, in which bright ones clip.
LONGER = 8.0


@dataclass(frozen=True)
class StillLife:
    """How to photograph a scene.

    Attributes
    ----------
    camera
        ISO and aperture.
    longest_s
        No exposure is longer.
    repeats
        Photographs at each exposure.
    """

    camera: CameraSettings
    longest_s: float
    repeats: int

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def dark_exposures_s(self, offers: CameraOffers) -> list[float]:
        """Shutter time of each dark frame."""
        exposures_s = {
            offers.exposure_at_most(self.longest_s * part) for part in (1 / 64, 1 / 8, 1)
        }
        return [exposure_s for exposure_s in sorted(exposures_s) for _ in range(DARKS_PER_EXPOSURE)]

    def photograph(self, session: Session, unit: str, purpose: str, lamp: str) -> None:
        """Meter, then take the bracket.

        Parameters
        ----------
        unit, purpose
            Of the frames.
        lamp
            What to call the light that should be there.

        Raises
        ------
        DeviceError
            It is dark.
        """
        offers = session.rig[CAMERA].offers()
        for exposure_s in self._ladder(offers):
            session.perform(Shoot(FrameRole.LOOK, self.settings(exposure_s)))
            if session.choose("bright enough", lambda: self._enough(session, unit), worst=False):
                break
        # That takes longest: both exposures of a bracket, and the longer one as long as it may be.
        worst_s = offers.exposure_at_most(self.longest_s / LONGER)
        exposure_s = session.choose(
            "exposure", lambda: self._exposure_s(session, unit, lamp), worst_s
        )
        longer_s = offers.exposure_at_most(min(exposure_s * LONGER, self.longest_s))
        for bracket_s in sorted({exposure_s, longer_s}):
            for _ in range(self.repeats):
                session.perform(Shoot(purpose, self.settings(bracket_s)))

    def _ladder(self, offers: CameraOffers) -> Sequence[float]:
        return sorted({offers.exposure_at_most(self.longest_s * share) for share in LADDER})

    def _enough(self, session: Session, unit: str) -> bool:
        return _seen(_looks(session, unit)[-1]).share > ENOUGH

    def _exposure_s(self, session: Session, unit: str, lamp: str) -> float:
        """Shutter time at which the brightest fills as much of the range as it should."""
        offers, looks = session.rig[CAMERA].offers(), _looks(session, unit)
        seen = [_seen(frame) for frame in looks]
        visible = [one for one in seen if one.visible]
        if not visible:
            raise DeviceError(
                f"{unit}: dark even in {duration_text(looks[-1].exposure_s)}: the {lamp} lamp did "
                "not light (check its bulb, its plug and the contact of its relay), or what should "
                "be seen is not in its place"
            )
        open_ones = [one for one in visible if not one.clips]
        if not open_ones:
            session.warn(
                f"{unit}: even the shortest exposure clips; lower camera.iso or close the aperture"
            )
            return offers.exposures_s[0]
        best = open_ones[-1]
        wanted_s = best.exposure_s * TARGET / best.share
        return offers.exposure_at_most(min(wanted_s, self.longest_s))


@dataclass(frozen=True)
class _Seen:
    """The brightest 0.5 % of a frame's pixels, as a share of the range."""

    exposure_s: float
    share: float
    visible: bool
    clips: bool


def _seen(frame: FrameRecord) -> _Seen:
    measured = measure(read_raw(frame.path))
    channels = list(measured.channels.values())
    brightest = max(channels, key=lambda channel: channel.peak)
    noise_dn = SEEN_SIGMA * brightest.sigma * np.sqrt(brightest.n)
    return _Seen(
        exposure_s=frame.exposure_s,
        share=brightest.peak / measured.range_dn,
        visible=brightest.mean > max(SEEN_SIGMA * brightest.sigma, SEEN_DN)
        or brightest.peak > max(noise_dn, SEEN_DN),
        clips=measured.clipped,
    )


def _looks(session: Session, unit: str) -> list[FrameRecord]:
    return [frame for frame in session.frames(FrameRole.LOOK) if frame.unit == unit]
