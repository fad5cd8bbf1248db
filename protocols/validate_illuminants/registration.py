"""Registration of the measurement `validate_illuminants`."""

from labrig.foundation.plugins import Measurement

VALIDATE_ILLUMINANTS = Measurement(
    package=__package__,
    protocol=".protocol:ValidateIlluminants",
    result=".result:ValidateIlluminantsResult",
    is_of_fluorescence=True,
)
