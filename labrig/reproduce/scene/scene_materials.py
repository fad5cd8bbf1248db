"""Materials of a scene in its bands, from their files."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import beside
from labrig.material import Albedo, Material, read_any_material, read_mixture
from labrig.optics import Transmittance, read_colour_chart, read_transmittance
from labrig.reproduce.scene.scene_file import AlbedoCurve, MaterialEntry
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.parameter_texture import read_parameter_texture
from labrig.reproduce.surface.surface_material import (
    BenchLight,
    SurfaceMaterial,
    of_albedo,
    of_matrix,
    of_mixture,
    of_phosphor,
)


@dataclass(frozen=True)
class Assumptions:
    """Assumptions that replace a measurement that is missing.

    Attributes
    ----------
    albedo
        Albedo of phosphors whose file has none.
    scale
        Factor from Λ to s sr⁻¹ of phosphors whose file has none.
    """

    albedo: float | None = None
    scale: float | None = None


NOTHING_ASSUMED = Assumptions()


def replaced_entries(
    entries: Mapping[str, MaterialEntry], replaced: Mapping[str, str], folder: Path
) -> dict[str, tuple[MaterialEntry, Path]]:
    """Return entries with the folders of their files, those replaced by the user's."""
    if unknown := set(replaced) - set(entries):
        raise UsageError(
            f"expected a material of the scene ({', '.join(entries)}), got '{min(unknown)}'"
        )
    return {
        name: (
            (
                entry.model_copy(
                    update={
                        "file": replaced[name],
                        "albedo": None,
                        "chart_patch": None,
                        "mixture": None,
                        "texture": None,
                    }
                ),
                Path(),
            )
            if name in replaced
            else (entry, folder)
        )
        for name, entry in entries.items()
    }


def scene_material(
    name: str,
    entry: MaterialEntry,
    folder: Path,
    bands: Bands,
    bench: BenchLight,
    assumptions: Assumptions,
) -> SurfaceMaterial:
    stored = None if entry.mixture is None else read_mixture(folder / entry.mixture)
    albedo = _reflectance(entry, folder)
    if albedo is not None:
        if stored is None or not entry.is_fluorescent:
            return of_albedo(name, albedo, bands)
        return of_mixture(name, stored, albedo, bands)
    assert entry.file is not None
    material = read_any_material(beside(entry.file, folder))
    if stored is not None:
        if isinstance(material, Material):
            raise UsageError(
                f"{name}: expected 'file' to be a measured matrix, whose reflectance the 'mixture' "
                f"needs, got the phosphor {material.name}"
            )
        if entry.is_fluorescent:
            return _named(name, of_mixture(material.name, stored, material, bands))
    if not isinstance(material, Material):
        if entry.texture is not None:
            raise UsageError(
                f"{name}: expected a phosphor for 'texture', got the matrix {material.name}"
            )
        if not entry.is_fluorescent:
            material = replace(material, reradiation=np.zeros_like(material.reradiation))
        return _named(name, of_matrix(material, bands))
    assumed, scale = entry.assume_albedo, entry.assume_scale
    phosphor = of_phosphor(
        material,
        bands,
        bench,
        assumed if assumptions.albedo is None else assumptions.albedo,
        scale if assumptions.scale is None else assumptions.scale,
        entry.prompt,
        None if entry.texture is None else read_parameter_texture(folder / entry.texture),
    )
    return _named(name, phosphor)


def _reflectance(entry: MaterialEntry, folder: Path) -> Albedo | Transmittance | float | None:
    """Return the reflectance that a scene gives a material, None of one that its file has."""
    if entry.chart_patch is not None:
        return read_colour_chart("colorchecker")[entry.chart_patch - 1]
    if isinstance(entry.albedo, str):
        return read_transmittance(beside(entry.albedo, folder))
    if isinstance(entry.albedo, AlbedoCurve):
        return Albedo(**entry.albedo.model_dump())
    return entry.albedo


def _named(name: str, material: SurfaceMaterial) -> SurfaceMaterial:
    """Return a material with its name in the scene before its own."""
    if name == material.name:
        return material
    return replace(material, name=f"{name} ({material.name})")
