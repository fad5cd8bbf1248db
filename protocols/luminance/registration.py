"""Registration of the measurement `luminance`."""

from labrig.foundation.plugins import Measurement

LUMINANCE = Measurement(
    package=__package__,
    protocol=".protocol:Luminance",
    result=".result:LuminanceResult",
)
