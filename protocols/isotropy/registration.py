"""Registration of the measurement `isotropy`."""

from labrig.foundation.plugins import Measurement

ISOTROPY = Measurement(
    package=__package__,
    protocol=".protocol:Isotropy",
    result=".result:IsotropyResult",
)
