"""Whether a calibration belongs to the camera of a run."""

from collections.abc import Sequence

from labrig.calibration import CameraFile
from labrig.record import FrameRecord, RunRecord
from labrig.reduce import read_exif


def camera_identity(run: RunRecord) -> str:
    """How the camera introduced itself in a run; empty if the journal does not say."""
    for attempt in run.attempts:
        if identity := dict(attempt.start.get("devices", {})).get("camera"):
            return str(identity)
    return ""


def lens_of(frames: Sequence[FrameRecord]) -> str | None:
    """What the first frame says of the lens: its name and focal length; None: nothing."""
    return read_exif(frames[0].path.read_bytes()).lens if frames else None


def insist_on_this_camera(
    camera: CameraFile | None, run: RunRecord, frames: Sequence[FrameRecord]
) -> None:
    """Refuse a calibration that is not of these frames; nothing is done where there is none.

    Raises
    ------
    DataError
        It is of another body, lens or aperture.
    """
    if camera is None or not frames:
        return
    lens = lens_of(frames)
    for f_number in {frame.f_number for frame in frames}:
        camera.insist_on(camera_identity(run), lens, f_number)
