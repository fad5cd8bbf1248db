"""Measurement of decays."""

from labrig.foundation.plugins import Measurement

DECAY = Measurement(
    package=__name__,
    protocol=".protocol:Decay",
    result=".result:DecayResult",
    options=".options:DecayOptions",
    table_report=".report:table_sections",
    is_per_patch=True,
)
