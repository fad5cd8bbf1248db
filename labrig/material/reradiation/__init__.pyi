from .checks import physical_warnings as physical_warnings
from .correction import (
    corrected as corrected,
    without_offset as without_offset,
    without_spill as without_spill,
)
from .emission import (
    emission_spectrum as emission_spectrum,
    read_emissions as read_emissions,
)
from .formats import (
    MatrixLayout as MatrixLayout,
    SpectralImage as SpectralImage,
    matrix_files as matrix_files,
    read_reradiation as read_reradiation,
    read_spectral_image as read_spectral_image,
    write_reradiation as write_reradiation,
)
from .matrix import (
    ReradiationMatrix as ReradiationMatrix,
    SeenSpectrum as SeenSpectrum,
)
from .mixture import (
    ConditionalDensity as ConditionalDensity,
    ReradiationMixture as ReradiationMixture,
)
from .mixture_file import (
    StoredMixture as StoredMixture,
    read_mixture as read_mixture,
)
from .noise import (
    InstrumentNoise as InstrumentNoise,
    instrument_noise as instrument_noise,
    reradiates as reradiates,
    with_sigma as with_sigma,
)
from .surface_colour import (
    REFERENCE_Y as REFERENCE_Y,
    Appearance as Appearance,
    ColourDifference as ColourDifference,
    ColourPair as ColourPair,
    appearance as appearance,
    colour_pair as colour_pair,
    compare_colours as compare_colours,
)
