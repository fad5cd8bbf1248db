"""Materials: their file, the rate equation and the comparison of two materials."""

from labrig.material.comparison import MaterialComparison, Pair, compare_materials
from labrig.material.file import (
    IrradianceNorm,
    Material,
    Provenance,
    Spectrum,
    State,
    read_material,
    write_material,
)
from labrig.material.rates import (
    concentration,
    exponential_means,
    phi1,
    phi2,
    relaxation_with_slopes,
)

__all__ = [
    "IrradianceNorm",
    "Material",
    "MaterialComparison",
    "Pair",
    "Provenance",
    "Spectrum",
    "State",
    "compare_materials",
    "concentration",
    "exponential_means",
    "phi1",
    "phi2",
    "read_material",
    "relaxation_with_slopes",
    "write_material",
]
