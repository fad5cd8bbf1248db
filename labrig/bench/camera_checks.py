"""Comparison of camera and lens with those with which a bench was calibrated, as a run begins."""

from labrig.acquire import CAMERA, RigFile, RunObserver
from labrig.bench.run_log import LoggedObserver
from labrig.bench_optics import calibration
from labrig.calibration import REFERENCE_KIND, ReferenceFile
from labrig.foundation.errors import ProtocolError
from labrig.foundation.input_file import MAX_FRAME_BYTES, read_bytes
from labrig.record import FrameRecord
from labrig.reduce import read_exif

ANEW = "calibrate the bench with this one (labrig run calibration), or use the other"


def require_calibrated_camera(rig: RigFile, devices: dict[str, str]) -> None:
    """Refuse another camera than that of the rig's calibration.

    Parameters
    ----------
    rig
        The rig file, with the calibrations that were found for it.
    devices
        Identities of the connected devices by their keys.

    Raises
    ------
    ProtocolError
        The camera is another one.
    """
    reference = calibration(rig, REFERENCE_KIND)
    camera = devices.get(CAMERA.key)
    if reference is not None and camera is not None and not reference.is_of(camera):
        raise ProtocolError(
            f"expected the calibrated camera, {reference.camera}, got {camera}; {ANEW}"
        )


class LensObserver(LoggedObserver):
    """Observer that compares the lens of the first frame with that of the rig's calibration.

    Parameters
    ----------
    observer
        Observer for the person at the terminal.
    rig
        The rig file, with the calibrations that were found for it.
    """

    def __init__(self, observer: RunObserver, rig: RigFile) -> None:
        super().__init__(observer)
        self._reference: ReferenceFile | None = calibration(rig, REFERENCE_KIND)
        self._only_warns = "lens" in rig.calibrations.only_warn

    def frame(self, record: FrameRecord) -> None:
        """Log that a frame was recorded; refuse the first one if it shows another lens.

        Raises
        ------
        ProtocolError
            The lens is another one.
        """
        super().frame(record)
        reference, self._reference = self._reference, None
        if reference is None or reference.lens is None:
            return
        lens = read_exif(read_bytes(record.path, MAX_FRAME_BYTES)).lens
        if lens is None or lens == reference.lens:
            return
        text = f"expected the calibrated lens, {reference.lens}, got {lens}"
        if not self._only_warns:
            raise ProtocolError(f"{text}; {ANEW}")
        self.warn(f"{text}: vignetting and place of the filter may be others")
