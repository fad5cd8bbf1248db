"""A design as a material file."""

import math

import numpy as np

from labrig.design.bands import Conversion
from labrig.design.light import LightProgramme
from labrig.design.nearest import material_radiance
from labrig.design.result import Design
from labrig.design.scene_spectra import SceneSpectra
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.material import (
    Albedo,
    IrradianceNorm,
    Material,
    Provenance,
    State,
    self_excitation,
)

#: Bands in nm of a design of three channels, as wide as its smooth spectra allow.
EDGES_NM = np.arange(400.0, 701.0, 20.0)
#: Largest part of a glow that excites it anew in a closed room.
FADING, TINY = 0.99, 1e-9
SOURCE = "Designed by labrig from wished-for colours, not measured"
SMOOTH = (
    "Designed in three channels (linear sRGB): re-radiation, excitation rates and albedo are the "
    "smoothest non-negative spectra of their colours, one choice of many"
)
COLOURS = (
    "Designed from colours in bands of wavelengths: re-radiation and a free albedo are the "
    "smoothest non-negative spectra of their colours, one choice of many"
)


def _reference_light(design: Design, conversion: Conversion) -> FloatArray:
    """Return the strongest light of a design in bands of wavelengths, shape (n,).

    The excitation rates of the material belong to it, and Λ is relative to its mean.
    """
    strongest = conversion.strongest_light(design.programme.irradiance)
    if not strongest.any():
        raise DataError("expected light in the programme of a design to be kept, got none")
    return strongest


def to_material(design: Design, name: str, light: SceneSpectra | None = None) -> Material:
    """Return a design as a material, to be written by `write_material`.

    Its scale is relative to the mean spectral irradiance of the programme's strongest light, to
    which its excitation rates belong, too; in a scene it is absolute. Parameters that the keys do
    not determine are named in its provenance.

    Parameters
    ----------
    design
        The design.
    name
        Name of the material.
    light
        Spectral light of a scene on the places of the design, from `SceneLight.spectra`.

    Returns
    -------
    Material
        Rates, re-radiation and albedo in bands of wavelengths: of three channels their smoothest
        spectra.

    Raises
    ------
    DataError
        There is no light in the programme.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, solve, three_bands, to_material
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    >>> material = to_material(solve(light, keys, three_bands(), albedo=0.5), "green")
    >>> material.scale, len(material.states[0].reradiation)
    ('relative', 15)
    """
    material = _under_own_light(design, name) if light is None else _in_scene(design, name, light)
    material, factor = _fading(material)
    differences = written_differences(design, material, light)
    note = _note(design, factor, float(differences.max()) if design.keys.count else None)
    return material.model_copy(update={"provenance": Provenance(source=SOURCE, note=note)})


def _under_own_light(design: Design, name: str) -> Material:
    """Return a material whose rates and Λ are relative to the programme's strongest light."""
    edges = EDGES_NM if design.bands.edges_nm is None else design.bands.edges_nm
    conversion = Conversion.to(design.bands, edges)
    light = _reference_light(design, conversion)
    mean = float(light.mean())
    lights = design.programme.irradiance.reshape(-1, design.bands.count)
    states = tuple(
        State(
            k_r_per_s=float(k_r),
            kinetic_order=design.order,
            k_e_per_s=_numbers(conversion.excitation(k_e) * mean),
            reradiation=_numbers(conversion.emission(emitted) / mean),
        )
        for k_r, k_e, emitted in zip(
            design.k_r_per_s, design.k_e_per_s, design.reradiation, strict=True
        )
    )
    return Material(
        name=name,
        kind="phosphor",
        bands_nm=_numbers(edges),
        irradiance_norm=IrradianceNorm(
            kind="vector_length", value=float(np.linalg.norm(light)) / mean
        ),
        states=states,
        scale="relative",
        albedo=Albedo(
            wavelength_nm=_numbers((edges[1:] + edges[:-1]) / 2),
            value=_numbers(conversion.albedo(design.albedo, lights)),
        ),
    )


def _in_scene(design: Design, name: str, light: SceneSpectra) -> Material:
    """Return a material in the units of a scene."""
    states = tuple(
        State(
            k_r_per_s=float(k_r),
            kinetic_order=design.order,
            k_e_per_s=_numbers(light.excitation(k_e)),
            reradiation=_numbers(light.emission(emitted)),
        )
        for k_r, k_e, emitted in zip(
            design.k_r_per_s, design.k_e_per_s, design.reradiation, strict=True
        )
    )
    edges = light.edges_nm
    return Material(
        name=name,
        kind="phosphor",
        bands_nm=_numbers(edges),
        states=states,
        scale="absolute",
        albedo=Albedo(
            wavelength_nm=_numbers((edges[1:] + edges[:-1]) / 2),
            value=_numbers(light.albedo(design.albedo)),
        ),
    )


def _fading(material: Material) -> tuple[Material, float]:
    """Return a material whose glow fades in a closed room of its own, and the factor of its Λ.

    The bands of a design may keep the energy where the spectra in them do not.
    """
    assert material.bands_nm is not None
    assert material.albedo is not None
    k_e = np.array([state.k_e_per_s for state in material.states])
    emitted = np.array([state.reradiation for state in material.states])
    if material.scale == "absolute":
        # Rates belong to the irradiance of a whole band, else to its mean.
        k_e = k_e * np.diff(material.bands_nm)
    albedo = np.minimum(material.albedo.value, 1 - TINY)
    factor = FADING / max(self_excitation(k_e, emitted, albedo), TINY)
    if factor >= 1:
        return material, 1.0
    states = tuple(
        state.model_copy(update={"reradiation": _numbers(factor * np.array(state.reradiation))})
        for state in material.states
    )
    return material.model_copy(update={"states": states}), factor


def written_factor(design: Design, light: SceneSpectra | None = None) -> float:
    """Return the factor of Λ by which the written material glows less than a design.

    The bands of a design may keep the energy where spectra in them do not.

    Parameters
    ----------
    design
        The design.
    light
        Spectral light of a scene on the places of the design.

    Returns
    -------
    float
        1, or below it.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, solve, three_bands, written_factor
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    >>> written_factor(solve(light, keys, three_bands(), albedo=0.5))
    1.0
    """
    material = _under_own_light(design, "any") if light is None else _in_scene(design, "any", light)
    return _fading(material)[1]


def written_differences(
    design: Design, material: Material, light: SceneSpectra | None = None
) -> FloatArray:
    """Return ΔE2000 of each key between what was wanted and how the written material looks.

    Under strongly coloured light three channels and spectra reflect differently.

    Parameters
    ----------
    design
        The design.
    material
        The material that `to_material` made of it.
    light
        Spectral light of a scene on the places of the design.

    Returns
    -------
    ndarray
        ΔE2000 as of a design, shape (keys,).

    Examples
    --------
    >>> from labrig.design import (
    ...     Keys, LightProgramme, solve, three_bands, to_material, written_differences
    ... )
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    >>> design = solve(light, keys, three_bands(), albedo=0.5)
    >>> bool(written_differences(design, to_material(design, "green")).max() < 0.1)
    True
    """
    assert material.bands_nm is not None
    assert material.albedo is not None
    keys, programme = design.keys, design.programme
    if light is not None:
        spectral = LightProgramme(light.begin_s, light.irradiance)
        in_bands = LightProgramme(light.begin_s, light.irradiance * np.diff(light.edges_nm))
        radiance = material_radiance(material, in_bands, keys.place, keys.time_s)
        radiance += spectral.at(keys.place, keys.time_s) * material.albedo.value / np.pi
        return design.differences_to(light.rgb(radiance) / np.pi)
    conversion = Conversion.to(design.bands, material.bands_nm)
    mean = float(_reference_light(design, conversion).mean())
    lit = LightProgramme(programme.begin_s, conversion.light(programme.irradiance) / mean)
    radiance = mean * material_radiance(material, lit, keys.place, keys.time_s)
    falling = conversion.light(programme.at(keys.place, keys.time_s))
    radiance += falling * material.albedo.value / np.pi
    return design.differences_to(radiance @ conversion.to_rgb.T)


def _note(design: Design, factor: float, largest_difference: float | None) -> str:
    notes = []
    if design.bands.edges_nm is None:
        notes.append(SMOOTH)
    elif design.keys.is_colour(design.bands):
        notes.append(COLOURS)
    unknown = [each.name for each in design.estimates if not each.is_determined]
    if unknown:
        notes.append(f"Not determined by the wishes: {', '.join(unknown)}")
    notes += [f"Not possible: {wish}" for wish in design.impossible]
    if factor < 1:
        notes.append(
            f"Its glow is {factor:.2g} of the design's, which would be more light than it takes"
        )
    if largest_difference is not None:
        notes.append(f"Largest ΔE2000 of a wish: {math.ceil(10 * largest_difference) / 10:g}")
    return ". ".join(notes) + "."


def _numbers(values: FloatArray) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values)
