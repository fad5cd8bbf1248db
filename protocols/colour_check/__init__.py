"""The check of colours by a chart."""

from labrig.foundation.plugins import Measurement

COLOUR_CHECK = Measurement(
    package=__name__,
    protocol=".protocol:ColourCheck",
    result=".result:ColourCheckResult",
    of="bench",
)
