from .fit import (
    BandedSpectrum as BandedSpectrum,
    SpectrumFit as SpectrumFit,
    fit_spectrum as fit_spectrum,
)
from .line import (
    LineFit as LineFit,
    fit_line as fit_line,
)
from .lines import DECISIVE as DECISIVE
from .system import (
    CurveError as CurveError,
    SpectralSystem as SpectralSystem,
    camera_modes as camera_modes,
    curve_modes as curve_modes,
    nonnegative_minimum as nonnegative_minimum,
    smooth_modes as smooth_modes,
    system_through_lvf as system_through_lvf,
)
