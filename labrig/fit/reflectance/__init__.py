"""Albedo of a sample that fluoresces and glows, from its light beside that of a grey card."""

from labrig.fit.reflectance.fit import (
    AlbedoFit,
    LitStrip,
    fit_albedo,
    relative_to_card,
    unresolved,
)

__all__ = ["AlbedoFit", "LitStrip", "fit_albedo", "relative_to_card", "unresolved"]
