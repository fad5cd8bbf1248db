"""Registration of the measurement `colour_check`."""

from labrig.foundation.plugins import Measurement

COLOUR_CHECK = Measurement(
    package=__package__,
    protocol=".protocol:ColourCheck",
    result=".result:ColourCheckResult",
    of="bench",
)
