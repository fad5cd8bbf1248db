"""Measurement of the irradiance on a sample."""

from labrig.foundation.plugins import Measurement

IRRADIANCE = Measurement(
    package=__name__,
    protocol=".protocol:Irradiance",
    result=".result:IrradianceResult",
    calibration="labrig.calibration:IRRADIANCE_KIND",
    of="bench",
)
