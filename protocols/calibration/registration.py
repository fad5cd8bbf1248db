"""Registration of the measurement `calibration`."""

from labrig.foundation.plugins import Measurement

CALIBRATION = Measurement(
    package=__package__,
    protocol=".protocol:Calibration",
    result=".result:CalibrationResult",
    calibration="labrig.calibration:REFERENCE_KIND",
    of="bench",
)
