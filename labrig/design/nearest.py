"""The measured materials that come nearest to what is wanted, alone and two side by side."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.bands import Conversion
from labrig.design.glow import emission
from labrig.design.light import LightProgramme, steps_to
from labrig.design.result import Design
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.material import Albedo, Material, Provenance, read_material

#: Share below which a material is not part of a mixture.
MIN_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class NearestMaterial:
    """One measured material, or two in small areas side by side, and how near it comes.

    Attributes
    ----------
    names
        Names of the materials.
    fractions
        Part of the area that each covers, in sum 1.
    brightness
        Factor of all Λ: they are measured in a unit of their own unless the file has a `scale`.
    material
        Material with the states of all, their Λ and albedo weighted by the fractions.
    rgb
        Linear sRGB at the keys, per sr, shape (keys, 3).
    delta_e2000
        ΔE2000 to the wanted colours at the keys, as of a design, shape (keys,).
    """

    names: tuple[str, ...]
    fractions: tuple[float, ...]
    brightness: float
    material: Material
    rgb: FloatArray
    delta_e2000: FloatArray


def presets() -> tuple[Material, ...]:
    """Return the shipped materials whose excitation and re-radiation are known in bands.

    Returns
    -------
    tuple of Material
        Materials by name.

    Examples
    --------
    >>> from labrig.design import presets
    >>> [material.name for material in presets()][:3]
    ['blue-paint', 'double-close-even', 'double-close-uneven']
    """
    shipped = (read_material(name) for name in sorted(resources.names("config/materials")))
    return tuple(material for material in shipped if _is_whole(material))


def nearest_materials(
    design: Design, materials: Sequence[Material] | None = None
) -> tuple[NearestMaterial, NearestMaterial | None]:
    """Return the measured material that is nearest to a design's keys, and the nearest two.

    The programme's strongest light is given the length to which a material's excitation rates
    belong. What is reflected is that of the material's albedo, or of the design's if it has none.

    Parameters
    ----------
    design
        Keys and light, and the albedo of materials that have none.
    materials
        Materials to choose from; the shipped ones without it.

    Returns
    -------
    one : NearestMaterial
        The nearest single material, by the mean ΔE2000 of the keys.
    two : NearestMaterial or None
        The nearest two by area fractions; None if no two are nearer than one.

    Raises
    ------
    UsageError
        There is no key, or no material has excitation rates and re-radiation in bands.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, nearest_materials, solve, three_bands
    >>> light = LightProgramme.checked([0.0, 60.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [61.0, 90.0], [[0.0, 0.003, 0.010], [0.0, 0.0012, 0.004]])
    >>> one, two = nearest_materials(solve(light, keys, three_bands(), albedo=0.5))
    >>> one.names
    ('blue-paint',)
    """
    if not design.keys.count:
        raise UsageError("expected at least one key to be near to, got none")
    usable = [each for each in (presets() if materials is None else materials) if _is_whole(each)]
    if not usable:
        raise UsageError(
            "expected a material with excitation rates and re-radiation in bands, got none; "
            "measure them (labrig run phosphor)"
        )
    parts = [_Part.of(design, material) for material in usable]
    ones = (_mixed(design, (part,)) for part in parts)
    best = min(ones, key=lambda found: float(found.delta_e2000.mean()))
    twos = (_mixed(design, pair) for pair in _pairs(parts))
    two = min(twos, key=lambda found: float(found.delta_e2000.mean()), default=None)
    if two is None or len(two.names) < 2 or two.delta_e2000.mean() >= best.delta_e2000.mean():
        return best, None
    return best, two


def material_radiance(
    material: Material,
    programme: LightProgramme,
    place: ArrayLike,
    time_s: ArrayLike,
) -> FloatArray:
    """Return the radiance that a material emits, in its own bands and unit.

    Parameters
    ----------
    material
        Material with excitation rates and re-radiation.
    programme
        Irradiance in the bands of the material, in the unit of its excitation rates.
    place
        Numbers of places, shape (n,) or one.
    time_s
        Times in s, shape (n,).

    Returns
    -------
    ndarray
        Radiance Σ Λ k_r rᵇ, shape (n, bands).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import LightProgramme, material_radiance
    >>> from labrig.material import read_material
    >>> blue = read_material("blue-paint")
    >>> light = np.zeros((2, 8))
    >>> light[0, 1] = 1.0
    >>> programme = LightProgramme.checked([0.0, 60.0], light)
    >>> material_radiance(blue, programme, 0, [60.0, 80.0])[:, 1].round(4).tolist()
    [0.0846, 0.0446]
    """
    times = np.asarray(time_s, dtype=np.float64)
    places = np.broadcast_to(np.asarray(place, dtype=np.intp), times.shape)
    steps = steps_to(programme, places, times)
    total = np.zeros((len(times), programme.irradiance.shape[2]))
    for state in material.states:
        k_e, k_r = np.array([state.k_e_per_s]), np.array([state.k_r_per_s])
        glow = emission(steps, len(times), k_e, k_r, state.kinetic_order)
        total += np.multiply.outer(glow.value[0], np.array(state.reradiation))
    return total


@dataclass(frozen=True, eq=False)
class _Part:
    """A material under the light of a design: what it emits and reflects at the keys, (keys, 3)."""

    material: Material
    emitted: FloatArray
    reflected: FloatArray

    @classmethod
    def of(cls, design: Design, material: Material) -> "_Part":
        assert material.bands_nm is not None
        assert material.irradiance_norm is not None
        conversion = Conversion.to(design.bands, material.bands_nm)
        lit = conversion.light(design.programme.irradiance)
        strongest = conversion.strongest_light(design.programme.irradiance)
        scale = material.irradiance_norm.value / max(float(np.linalg.norm(strongest)), 1e-300)
        # On a scale relative to the lamp, the lamp's mean spectral irradiance is the unit.
        unit = float(strongest.mean()) if material.scale == "relative" else 1.0
        keys = design.keys
        scaled = LightProgramme(design.programme.begin_s, scale * lit)
        emitted = unit * material_radiance(material, scaled, keys.place, keys.time_s)
        light = design.programme.at(keys.place, keys.time_s) / np.pi
        reflected = (design.albedo * light) @ design.bands.to_rgb.T
        if material.albedo is not None:
            middles = (np.array(material.bands_nm[1:]) + np.array(material.bands_nm[:-1])) / 2
            back = np.interp(middles, material.albedo.wavelength_nm, material.albedo.value)
            reflected = (back * conversion.light(light)) @ conversion.to_rgb.T
        return cls(material, emitted @ conversion.to_rgb.T, reflected)


def _mixed(design: Design, parts: Sequence[_Part]) -> NearestMaterial:
    """Return the best mixture of one or two materials; of two it may be one."""
    wanted = design.keys.rgb(design.bands)
    weight = (1 / design.keys.luminance(design.bands))[:, np.newaxis]
    has_scale = all(part.material.scale == "relative" for part in parts)
    reflected = np.mean([part.reflected for part in parts], axis=0)
    columns = np.stack([(weight * part.emitted).ravel() for part in parts], axis=1)
    target = (weight * (wanted - reflected)).ravel()
    if has_scale:
        # Fractions are 1 in sum: a row that weighs more than all keys.
        heavy = 1e4 * float(np.abs(columns).max())
        columns = np.vstack([columns, np.full((1, len(parts)), heavy)])
        target = np.append(target, heavy)
    shares = nonnegative_least_squares(columns, target)
    brightness = float(shares.sum())
    fractions = shares / brightness if brightness > 0 else np.full(len(parts), 1 / len(parts))
    kept = [number for number in range(len(parts)) if fractions[number] > MIN_SHARE]
    reflected = sum(
        (fractions[number] * parts[number].reflected for number in kept), np.zeros_like(wanted)
    )
    emitted = sum((shares[number] * parts[number].emitted for number in kept), reflected)
    chosen = [parts[number].material for number in kept]
    areas = tuple(float(fractions[number]) for number in kept)
    return NearestMaterial(
        tuple(material.name for material in chosen),
        areas,
        brightness,
        _by_area(chosen, areas),
        emitted,
        design.differences_to(emitted),
    )


def _pairs(parts: Sequence[_Part]) -> Iterator[tuple[_Part, _Part]]:
    """Yield pairs of materials that one file could hold."""
    for first, second in combinations(parts, 2):
        one, other = first.material, second.material
        same = ("bands_nm", "irradiance_norm", "scale")
        if all(getattr(one, name) == getattr(other, name) for name in same):
            yield first, second


def _by_area(materials: Sequence[Material], fractions: Sequence[float]) -> Material:
    """Return one material with all states, Λ and albedo weighted by the fractions."""
    if len(materials) == 1:
        return materials[0]
    states = []
    for material, fraction in zip(materials, fractions, strict=True):
        for state in material.states:
            emitted = tuple(fraction * value for value in state.reradiation or ())
            states.append(
                state.model_copy(
                    update={
                        "reradiation": emitted,
                        "reradiation_range": None,
                        "reradiation_sigma": None,
                        "amplitude": None,
                        "amplitude_sigma": None,
                    }
                )
            )
    parts = " and ".join(
        f"{100 * fraction:.0f} % {material.name}"
        for material, fraction in zip(materials, fractions, strict=True)
    )
    return Material(
        name=parts,
        kind="phosphor",
        bands_nm=materials[0].bands_nm,
        irradiance_norm=materials[0].irradiance_norm,
        states=tuple(states),
        scale=materials[0].scale,
        albedo=_mixed_albedo(materials, fractions),
        provenance=Provenance(
            source=f"{parts} of the area, in areas too small to be distinguished"
        ),
    )


def _mixed_albedo(materials: Sequence[Material], fractions: Sequence[float]) -> Albedo | None:
    known = [material.albedo for material in materials if material.albedo is not None]
    if len(known) < len(materials):
        return None
    grid = np.unique(np.concatenate([albedo.wavelength_nm for albedo in known]))
    value = sum(
        (
            fraction * np.interp(grid, albedo.wavelength_nm, albedo.value)
            for fraction, albedo in zip(fractions, known, strict=True)
        ),
        np.zeros(len(grid)),
    )
    return Albedo(wavelength_nm=tuple(grid.tolist()), value=tuple(value.tolist()))


def _is_whole(material: Material) -> bool:
    """Return whether a material has all that predicts its glow under any light."""
    return (
        material.bands_nm is not None
        and material.irradiance_norm is not None
        and all(state.k_e_per_s and state.reradiation for state in material.states)
    )
