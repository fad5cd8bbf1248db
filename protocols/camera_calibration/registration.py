"""Registration of the measurement `camera_calibration`."""

from labrig.foundation.plugins import Measurement

CAMERA_CALIBRATION = Measurement(
    package=__package__,
    protocol=".protocol:CameraCalibration",
    result=".result:CameraCalibrationResult",
    calibration="labrig.calibration:CAMERA_KIND",
    of="bench",
)
