"""Materials: their file, their rates and what follows from them."""

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

__all__ = [
    "IrradianceNorm",
    "Material",
    "MaterialComparison",
    "Pair",
    "Provenance",
    "Spectrum",
    "State",
    "compare_materials",
    "read_material",
    "write_material",
]
