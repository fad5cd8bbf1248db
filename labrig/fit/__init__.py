"""Fits: the least-squares core; decays, spectra, filters, excitation, mixtures fitted with it."""

from labrig.fit.bispectral import (
    BispectralColumns,
    LitSpectrum,
    SeparatedColumns,
    bispectral_columns,
    separate_columns,
)
from labrig.fit.charge import ChargeCandidate, ChargeFit, OrderState, fit_charge_and_decay
from labrig.fit.decay import (
    DecayFit,
    DecayTable,
    Periodogram,
    fit_decay,
    fit_shared_rates,
    periodogram,
)
from labrig.fit.least_squares import EPSILON, Ending, LeastSquaresFit, least_squares
from labrig.fit.luminance import fit_luminance
from labrig.fit.mixture import (
    HeldOutError,
    LightKept,
    MixtureCandidate,
    MixtureFit,
    MixtureTexture,
    fit_mixture,
    fit_mixture_texture,
)
from labrig.fit.power_law import PowerLaw, fit_power_law
from labrig.fit.trap_depth import fit_trap_depth

__all__ = [
    "EPSILON",
    "BispectralColumns",
    "ChargeCandidate",
    "ChargeFit",
    "DecayFit",
    "DecayTable",
    "Ending",
    "HeldOutError",
    "LeastSquaresFit",
    "LightKept",
    "LitSpectrum",
    "MixtureCandidate",
    "MixtureFit",
    "MixtureTexture",
    "OrderState",
    "Periodogram",
    "PowerLaw",
    "SeparatedColumns",
    "bispectral_columns",
    "fit_charge_and_decay",
    "fit_decay",
    "fit_luminance",
    "fit_mixture",
    "fit_mixture_texture",
    "fit_power_law",
    "fit_shared_rates",
    "fit_trap_depth",
    "least_squares",
    "periodogram",
    "separate_columns",
]
