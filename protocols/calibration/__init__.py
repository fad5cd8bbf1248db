"""Measurement of a bench's calibration, as a chain."""

from labrig.foundation.plugins import Measurement

CALIBRATION = Measurement(
    package=__name__,
    protocol=".protocol:Calibration",
    result=".result:CalibrationResult",
    calibration="labrig.calibration:REFERENCE_KIND",
    of="bench",
)
