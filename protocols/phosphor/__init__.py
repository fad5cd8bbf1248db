"""Measurement of a phosphor, as a chain."""

from labrig.foundation.plugins import Measurement

PHOSPHOR = Measurement(
    package=__name__,
    protocol=".protocol:Phosphor",
    result=".result:PhosphorResult",
)
