"""Registration of the measurement `irradiance`."""

from labrig.foundation.plugins import Measurement

IRRADIANCE = Measurement(
    package=__package__,
    protocol=".protocol:Irradiance",
    result=".result:IrradianceResult",
    calibration="labrig.calibration:IRRADIANCE_KIND",
    of="bench",
)
