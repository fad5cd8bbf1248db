"""Surface and layer of a material, by a reflectance run and the protocol."""

from collections.abc import Mapping
from typing import Any

from labrig.acquire import Sample
from labrig.calibration import PatchReflectance, ReflectanceFile
from labrig.material import Albedo, Material, RadianceFactor


def with_reflectance(
    material: Material, patch: str, reflectance: ReflectanceFile | None
) -> Material:
    """Return the material with albedo and radiance factor, if its patch was measured.

    Parameters
    ----------
    material
        Material of the patch.
    patch
        Name of the patch; "" of the only one, which takes the only entry whatever its name.
    reflectance
        Reflectance file; None leaves the material as it is.
    """
    measured = patch_reflectance(patch, reflectance)
    if measured is None or reflectance is None:
        return material
    return material.model_copy(
        update={
            "albedo": Albedo(
                wavelength_nm=measured.wavelength_nm,
                value=tuple(min(value, MAX_ALBEDO) for value in measured.albedo),
                sigma=measured.albedo_sigma,
                common_sigma=measured.common_sigma,
            ),
            "radiance_factor": RadianceFactor(
                lamp=reflectance.lamp,
                wavelength_nm=measured.wavelength_nm,
                value=measured.radiance_factor,
                sigma=measured.radiance_factor_sigma,
            ),
        }
    )


def with_layer(material: Material, sample: Sample) -> Material:
    """Return the material with the thickness and mass per area that the protocol states."""
    return material.model_copy(
        update={
            "thickness_mm": sample.thickness,
            "mass_per_area_g_per_m2": sample.mass_per_area,
        }
    )


#: Largest albedo that a material file may have.
MAX_ALBEDO = 1.2


def with_reflectances(
    materials: Mapping[str, Material], reflectance: ReflectanceFile | None
) -> dict[str, Any]:
    """Return the materials by patch, each with its albedo, if it was measured."""
    return {
        name: with_reflectance(material, name if len(materials) > 1 else "", reflectance)
        for name, material in materials.items()
    }


def patch_reflectance(patch: str, reflectance: ReflectanceFile | None) -> PatchReflectance | None:
    """Return the numbers of a patch; None if it was not measured."""
    if reflectance is None:
        return None
    if not patch and len(reflectance.patches) == 1:
        return next(iter(reflectance.patches.values()))
    return reflectance.patches.get(patch)
