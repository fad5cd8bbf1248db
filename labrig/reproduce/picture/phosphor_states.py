"""Levels of the phosphors of a scene, at the places that are made of them."""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import Float32Array, Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.surface.field import Field
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.geometry import Geometry


@dataclass(frozen=True, eq=False)
class PhosphorState:
    """Levels of one phosphor, at all places that are made of it.

    Attributes
    ----------
    name
        Name of the material in the scene.
    material
        Number of the material.
    places
        Numbers of its places, shape (places,).
    texels
        Texel of its texture at each of them; None without a texture.
    field
        Its levels.
    is_charged
        Whether it begins in equilibrium with the light.
    """

    name: str
    material: int
    places: Int32Array
    texels: Int32Array | None
    field: Field
    is_charged: bool


def phosphor_states(scene: Scene, geometry: Geometry) -> list[PhosphorState]:
    """Return the phosphors that are somewhere in the scene."""
    has_samples = np.concatenate(
        [np.full(surface.n_places, surface.samples is not None) for surface in geometry.surfaces]
    )
    entries = list(scene.file.materials.values())
    states = []
    for number, material in enumerate(scene.materials):
        places = np.flatnonzero((geometry.material_of_place == number) & has_samples)
        if material.parameters is None or not len(places):
            continue
        given = entries[number].levels
        is_charged = given == "charged"
        texels, parameters = None, material.parameters
        if material.texture is not None:
            texels = _texels(material, number, geometry)[places]
            parameters = parameters.at(texels)
        field = Field(parameters, len(places), 0.0 if given == "charged" else given)
        name = list(scene.file.materials)[number]
        states.append(
            PhosphorState(name, number, places.astype(np.int32), texels, field, is_charged)
        )
    return states


def _texels(material: SurfaceMaterial, number: int, geometry: Geometry) -> Int32Array:
    """Return the texel of a material's texture at every place, zero of others, shape (places,)."""
    assert material.texture is not None
    texels = np.zeros(geometry.n_places, np.int32)
    for index, surface in enumerate(geometry.surfaces):
        own = geometry.places_of(index)
        if surface.samples is None or not (geometry.material_of_place[own] == number).any():
            continue
        if (uv := surface.uv_of_places) is None:
            raise UsageError(
                f"{surface.name}: expected texture coordinates for the 'texture' of "
                f"{material.name}, got a surface without"
            )
        texels[own] = material.texture.texel_at(uv)
    return texels


def albedo_factor(scene: Scene, states: list[PhosphorState], n_places: int) -> Float32Array | None:
    """Return the factor of the albedo of every place, None where there is none."""
    factor = np.ones(n_places, np.float32)
    for state in states:
        texture = scene.materials[state.material].texture
        of_texel = None if texture is None else texture.texels("albedo_factor")
        if of_texel is not None and state.texels is not None:
            factor[state.places] = of_texel[state.texels]
    return None if (factor == 1).all() else factor
