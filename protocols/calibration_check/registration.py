"""Registration of the measurement `calibration_check`."""

from labrig.foundation.plugins import Measurement

CALIBRATION_CHECK = Measurement(
    package=__package__,
    protocol=".protocol:CalibrationCheck",
    result=".result:CalibrationCheckResult",
    report=None,
    of="bench",
    is_bench_check=True,
)
