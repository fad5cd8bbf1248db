"""Albedo of a sample that fluoresces and glows, from its light beside that of a grey card."""

from labrig.fit.reflectance.fit import (
    AlbedoFit,
    LitStrip,
    fit_albedo,
    relative_to_card,
    unresolved,
)
from labrig.fit.reflectance.luminescence import (
    Luminescence,
    StripLight,
    luminescence_by_glow,
)

__all__ = [
    "AlbedoFit",
    "LitStrip",
    "Luminescence",
    "StripLight",
    "fit_albedo",
    "luminescence_by_glow",
    "relative_to_card",
    "unresolved",
]
