from .bispectral import (
    BispectralColumns as BispectralColumns,
    IlluminatedSpectrum as IlluminatedSpectrum,
    SeparatedColumns as SeparatedColumns,
    bispectral_columns as bispectral_columns,
    separate_columns as separate_columns,
)
from .charge import (
    ChargeCandidate as ChargeCandidate,
    ChargeFit as ChargeFit,
    OrderState as OrderState,
    fit_charge_and_decay as fit_charge_and_decay,
)
from .decay import (
    DecayFit as DecayFit,
    DecayTable as DecayTable,
    Periodogram as Periodogram,
    fit_decay as fit_decay,
    fit_shared_rates as fit_shared_rates,
    periodogram as periodogram,
)
from .luminance import fit_luminance as fit_luminance
from .mixture import (
    HeldOutError as HeldOutError,
    LightKept as LightKept,
    MixtureCandidate as MixtureCandidate,
    MixtureFit as MixtureFit,
    MixtureTexture as MixtureTexture,
    fit_mixture as fit_mixture,
    fit_mixture_texture as fit_mixture_texture,
)
from .nonlinear_least_squares import (
    EPSILON as EPSILON,
    Ending as Ending,
    LeastSquaresFit as LeastSquaresFit,
    least_squares as least_squares,
)
from .power_law import (
    PowerLaw as PowerLaw,
    fit_power_law as fit_power_law,
)
from .trap_depth import fit_trap_depth as fit_trap_depth
