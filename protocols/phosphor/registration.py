"""Registration of the measurement `phosphor`."""

from labrig.foundation.plugins import Measurement

PHOSPHOR = Measurement(
    package=__package__,
    protocol=".protocol:Phosphor",
    result=".result:PhosphorResult",
)
