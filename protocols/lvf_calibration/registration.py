"""Registration of the measurement `lvf_calibration`."""

from labrig.foundation.plugins import Measurement

LVF_CALIBRATION = Measurement(
    package=__package__,
    protocol=".protocol:LvfCalibration",
    result=".result:LvfCalibrationResult",
    calibration="labrig.calibration:LVF_KIND",
    of="bench",
)
