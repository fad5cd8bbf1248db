"""Measurement of excitation."""

from labrig.foundation.plugins import Measurement

EXCITATION = Measurement(
    package=__name__,
    protocol=".protocol:Excitation",
    result=".result:ExcitationResult",
    options=".options:ExcitationOptions",
    is_per_patch=True,
    needs_checked_bench=True,
    has_short_charges=True,
)
