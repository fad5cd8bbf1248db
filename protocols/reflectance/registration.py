"""Registration of the measurement `reflectance`."""

from labrig.foundation.plugins import Measurement

REFLECTANCE = Measurement(
    package=__package__,
    protocol=".protocol:Reflectance",
    result=".result:ReflectanceResult",
    calibration="labrig.calibration:REFLECTANCE_KIND",
    is_per_patch=True,
)
