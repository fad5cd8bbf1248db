"""Measurement of predictions under other lamps."""

from labrig.foundation.plugins import Measurement

VALIDATE_ILLUMINANTS = Measurement(
    package=__name__,
    protocol=".protocol:ValidateIlluminants",
    result=".result:ValidateIlluminantsResult",
    is_of_fluorescence=True,
)
