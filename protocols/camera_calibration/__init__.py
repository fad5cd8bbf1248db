"""Measurement of the calibration of a camera."""

from labrig.foundation.plugins import Measurement

CAMERA_CALIBRATION = Measurement(
    package=__name__,
    protocol=".protocol:CameraCalibration",
    result=".result:CameraCalibrationResult",
    calibration="labrig.calibration:CAMERA_KIND",
    of="bench",
)
