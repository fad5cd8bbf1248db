from .any_material import (
    YAML as YAML,
    read_any_material as read_any_material,
)
from .comparison import (
    MaterialComparison as MaterialComparison,
    Pair as Pair,
    compare_materials as compare_materials,
)
from .decay_laws import (
    DECAY_LAWS as DECAY_LAWS,
    DecayLaw as DecayLaw,
)
from .file import (
    MAX_ORDER as MAX_ORDER,
    SEEN_FACTOR as SEEN_FACTOR,
    Albedo as Albedo,
    IrradianceNorm as IrradianceNorm,
    Material as Material,
    Provenance as Provenance,
    RadianceFactor as RadianceFactor,
    ScaleFactor as ScaleFactor,
    Spectrum as Spectrum,
    State as State,
    material_text as material_text,
    read_material as read_material,
    write_material as write_material,
)
from .fluorescent import (
    FluorescentMaterial as FluorescentMaterial,
    read_fluorescent as read_fluorescent,
    write_fluorescent as write_fluorescent,
)
from .general_order import (
    BecquerelDecay as BecquerelDecay,
    DarkStep as DarkStep,
    LitStep as LitStep,
    becquerel_of as becquerel_of,
    dark_concentration as dark_concentration,
    dark_step as dark_step,
    lit_concentration as lit_concentration,
    lit_step as lit_step,
    mean_emission as mean_emission,
    steady_concentration as steady_concentration,
)
from .rates import (
    concentration as concentration,
    exponential_means as exponential_means,
    exponential_means_and_slopes as exponential_means_and_slopes,
    phi1 as phi1,
    phi2 as phi2,
    relaxation_with_slopes as relaxation_with_slopes,
)
from .reradiation import (
    REFERENCE_Y as REFERENCE_Y,
    Appearance as Appearance,
    ColourDifference as ColourDifference,
    ColourPair as ColourPair,
    ConditionalDensity as ConditionalDensity,
    InstrumentNoise as InstrumentNoise,
    MatrixLayout as MatrixLayout,
    ReradiationMatrix as ReradiationMatrix,
    ReradiationMixture as ReradiationMixture,
    SeenSpectrum as SeenSpectrum,
    SpectralImage as SpectralImage,
    StoredMixture as StoredMixture,
    appearance as appearance,
    colour_pair as colour_pair,
    compare_colours as compare_colours,
    corrected as corrected,
    emission_spectrum as emission_spectrum,
    instrument_noise as instrument_noise,
    matrix_files as matrix_files,
    physical_warnings as physical_warnings,
    read_emissions as read_emissions,
    read_mixture as read_mixture,
    read_reradiation as read_reradiation,
    read_spectral_image as read_spectral_image,
    reradiates as reradiates,
    with_sigma as with_sigma,
    without_offset as without_offset,
    without_spill as without_spill,
    write_reradiation as write_reradiation,
)
from .self_excitation import (
    self_excitation as self_excitation,
)
