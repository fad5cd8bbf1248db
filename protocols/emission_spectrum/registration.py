"""Registration of the measurement `emission_spectrum`."""

from labrig.foundation.plugins import Measurement

EMISSION_SPECTRUM = Measurement(
    package=__package__,
    protocol=".protocol:EmissionSpectrum",
    result=".result:EmissionSpectrumResult",
    is_per_patch=True,
    needs_checked_bench=True,
)
