"""Dark frames while a sample may still glow from earlier, and waiting until it does not."""

from collections.abc import Sequence

from labrig.acquire import ExposureSettings, Session, Shoot
from labrig.quantity import duration_text
from labrig.region import Region

from .darkness import darkness
from .metering import look
from .posing import face_camera, face_lamp, has_door

#: How often the sample is looked at, and for how long at most.
CHECK_EVERY_S = 180.0
AT_MOST_S = 3600.0
#: A glow that fades by less between two looks is none.
FADES = 0.05


def shoot_darkness(session: Session, exposures: Sequence[ExposureSettings]) -> None:
    """Dark frames; with its door closed a bench is dark whatever the sample still glows."""
    face_lamp(session)
    for settings in exposures:
        session.perform(Shoot("dark", settings))


def rest_until_dark(
    session: Session, unit: str, regions: Sequence[Region], exposures: Sequence[ExposureSettings]
) -> None:
    """Wait while a sample behind a door glows from earlier; without a door the dark frames tell.

    A plan assumes that it does not.

    Parameters
    ----------
    unit
        That waits.
    regions
        Where the sample lies.
    exposures
        Those of its dark frames.
    """
    if not has_door(session):
        return
    by_length = sorted(exposures, key=lambda settings: settings.exposure_s)
    face_camera(session)
    before, rested_s = 1.0, 0.0
    while True:
        for settings in (by_length[0], by_length[-1]):
            session.perform(Shoot("rest", settings))
        glow = session.choose("glow from before", lambda: _glow(session, unit, regions), worst=0.0)
        fades = glow < (1 - FADES) * before or glow >= 1
        if not glow or not fades or rested_s >= AT_MOST_S:
            break
        before = glow
        session.wait(CHECK_EVERY_S, "the sample still glows, resting in the dark")
        rested_s += CHECK_EVERY_S
    if glow:
        session.warn(
            f"after {duration_text(rested_s)} in the dark the sample still shows "
            f"{100 * glow:.2g} % of the camera's range in {by_length[-1].exposure_s:.2g} s: it "
            "glows from earlier, or a light is on in the room; longer in the dark before a run is "
            "better"
        )


def _glow(session: Session, unit: str, regions: Sequence[Region]) -> float:
    """Share of the range that the last two looks show."""
    frames = [frame for frame in session.frames("rest") if frame.unit == unit][-2:]
    return darkness([look(frame, regions) for frame in frames], frames[0].iso).light
