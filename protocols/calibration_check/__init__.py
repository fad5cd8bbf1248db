"""The check that a calibrated bench is as it was."""

from labrig.foundation.plugins import Measurement

CALIBRATION_CHECK = Measurement(
    package=__name__,
    protocol=".protocol:CalibrationCheck",
    result=".result:CalibrationCheckResult",
    report=None,
    of="bench",
    is_bench_check=True,
)
