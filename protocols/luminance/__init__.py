"""Measurement of luminance."""

from labrig.foundation.plugins import Measurement

LUMINANCE = Measurement(
    package=__name__,
    protocol=".protocol:Luminance",
    result=".result:LuminanceResult",
)
