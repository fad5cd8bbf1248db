"""Measurement of the calibration of the variable filter."""

from labrig.foundation.plugins import Measurement

LVF_CALIBRATION = Measurement(
    package=__name__,
    protocol=".protocol:LvfCalibration",
    result=".result:LvfCalibrationResult",
    calibration="labrig.calibration:LVF_KIND",
    of="bench",
)
