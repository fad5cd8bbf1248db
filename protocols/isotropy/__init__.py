"""Measurement of the isotropy of a glow."""

from labrig.foundation.plugins import Measurement

ISOTROPY = Measurement(
    package=__name__,
    protocol=".protocol:Isotropy",
    result=".result:IsotropyResult",
)
