"""Measurement of saturation."""

from labrig.foundation.plugins import Measurement

SATURATION = Measurement(
    package=__name__,
    protocol=".protocol:Saturation",
    result=".result:SaturationResult",
    options=".options:SaturationOptions",
    is_per_patch=True,
)
