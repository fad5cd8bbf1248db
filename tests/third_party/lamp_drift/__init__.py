"""The drift of a lamp: driver, protocol, calibration, analysis and result in one package."""

from labrig.foundation.plugins import Measurement

LAMP_DRIFT = Measurement(
    package=__name__,
    protocol=".protocol:LampDrift",
    result=".result:LampDriftResult",
    report=None,
    calibration=".calibration:DRIFT_KIND",
    of="bench",
)
