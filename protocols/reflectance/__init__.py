"""Measurement of reflectance."""

from labrig.foundation.plugins import Measurement

REFLECTANCE = Measurement(
    package=__name__,
    protocol=".protocol:Reflectance",
    result=".result:ReflectanceResult",
    calibration="labrig.calibration:REFLECTANCE_KIND",
    is_per_patch=True,
)
