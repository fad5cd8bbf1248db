"""Registration of the measurement: what it is made of, by import strings."""

from labrig.foundation.plugins import Measurement

LAMP_DRIFT = Measurement(
    package="lamp_drift",
    protocol=".protocol:LampDrift",
    result=".result:LampDriftResult",
    report=None,
    calibration=".calibration:DRIFT_KIND",
    of="bench",
)
