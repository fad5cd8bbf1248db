"""Re-radiation matrices of fluorescent surfaces: files, colours, uncertainties."""

from labrig.material.reradiation.appearance import (
    REFERENCE_Y,
    Appearance,
    ColourDifference,
    ColourPair,
    appearance,
    colour_pair,
    compare_colours,
)
from labrig.material.reradiation.checks import (
    physical_warnings,
)
from labrig.material.reradiation.correction import (
    corrected,
    without_offset,
    without_spill,
)
from labrig.material.reradiation.emission import (
    emission_spectrum,
    read_emissions,
)
from labrig.material.reradiation.formats import (
    MatrixLayout,
    SpectralImage,
    matrix_files,
    read_reradiation,
    read_spectral_image,
    write_reradiation,
)
from labrig.material.reradiation.matrix import (
    ReradiationMatrix,
    SeenSpectrum,
)
from labrig.material.reradiation.mixture import (
    ConditionalDensity,
    ReradiationMixture,
)
from labrig.material.reradiation.mixture_file import (
    StoredMixture,
    read_mixture,
)
from labrig.material.reradiation.noise import (
    InstrumentNoise,
    instrument_noise,
    reradiates,
    with_sigma,
)

__all__ = [
    "REFERENCE_Y",
    "Appearance",
    "ColourDifference",
    "ColourPair",
    "ConditionalDensity",
    "InstrumentNoise",
    "MatrixLayout",
    "ReradiationMatrix",
    "ReradiationMixture",
    "SeenSpectrum",
    "SpectralImage",
    "StoredMixture",
    "appearance",
    "colour_pair",
    "compare_colours",
    "corrected",
    "emission_spectrum",
    "instrument_noise",
    "matrix_files",
    "physical_warnings",
    "read_emissions",
    "read_mixture",
    "read_reradiation",
    "read_spectral_image",
    "reradiates",
    "with_sigma",
    "without_offset",
    "without_spill",
    "write_reradiation",
]
