"""Measurement of emission spectra."""

from labrig.foundation.plugins import Measurement

EMISSION_SPECTRUM = Measurement(
    package=__name__,
    protocol=".protocol:EmissionSpectrum",
    result=".result:EmissionSpectrumResult",
    is_per_patch=True,
    needs_checked_bench=True,
)
