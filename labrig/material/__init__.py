"""Materials: their file, their rates and what follows from them."""

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
    "Provenance",
    "Spectrum",
    "State",
    "read_material",
    "write_material",
]
