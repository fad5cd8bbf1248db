"""Dark frames of a sample that may still glow from earlier: first it rests until it does not."""

from collections.abc import Sequence

import numpy as np

from labrig.acquire import ExposureSettings, Session, Shoot
from labrig.quantity import duration_text
from labrig.record import FrameRole
from labrig.region import Region

from .afterglow import glow
from .darkness import levels, range_dn
from .metering import look
from .posing import face_camera, face_lamp, has_door

#: How often the sample is looked at, and for how long at most.
CHECK_EVERY_S = 180.0
AT_MOST_S = 3600.0
#: A light that fades by less between two looks does not fade.
FADES = 0.05
#: Less light than this share of the range is none.
LEAST = 5e-4


def dark_frames(
    session: Session, unit: str, regions: Sequence[Region], exposures: Sequence[ExposureSettings]
) -> None:
    """Dark frames as the sample is seen later; behind a door it rests before until it is dark.

    Without a door the dark frames alone can tell. A plan assumes a sample that is dark.

    Parameters
    ----------
    unit
        That takes them.
    regions
        Where the sample lies.
    """
    if has_door(session):
        longest = max(exposures, key=lambda settings: settings.exposure_s)
        _rest_until_dark(session, unit, regions, longest)
    for settings in exposures:
        session.perform(Shoot(FrameRole.DARK, settings))


def _rest_until_dark(
    session: Session, unit: str, regions: Sequence[Region], longest: ExposureSettings
) -> None:
    """Ends with the door open. What the camera sees behind the closed one is what dark means."""
    face_lamp(session)
    session.perform(Shoot(FrameRole.REST, longest))
    face_camera(session)
    before, rested_s = np.inf, 0.0
    while True:
        session.perform(Shoot(FrameRole.REST, longest))
        light = session.choose("light before", lambda: _light(session, unit, regions), worst=0.0)
        fades = light < (1 - FADES) * before
        if not light or not fades or rested_s >= AT_MOST_S:
            break
        before = light
        session.wait(CHECK_EVERY_S, "the sample still glows, resting in the dark")
        rested_s += CHECK_EVERY_S
    if light:
        what = (
            "a light is on in the room, or leaks in; it is subtracted as long as it stays the same"
            if not fades
            else "the sample glows from earlier; longer in the dark before a run is better"
        )
        session.warn(
            f"after {duration_text(rested_s)} in the dark the sample's place is not dark: "
            f"{100 * light:.2g} % of the camera's range in {longest.exposure_s:.2g} s; {what}"
        )


def _light(session: Session, unit: str, regions: Sequence[Region]) -> float:
    """Share of the range by which the last look is brighter than the closed door; 0 for noise."""
    closed, *_, seen = (frame for frame in session.frames(FrameRole.REST) if frame.unit == unit)
    dark = look(closed, regions)
    found = glow(look(seen, regions), levels(dark), seen.start_time)
    share = found.brightest * seen.exposure_s / range_dn(dark)
    return share if found.clips or (found.seen and share > LEAST) else 0.0
