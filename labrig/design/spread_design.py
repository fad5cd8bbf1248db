"""A material of its own for each dot of a scene, spread over the surface they lie on.

Strengths may differ by powers of ten, so that halfway between two is their geometric mean. A
spectrum has bands without light, whose logarithm there is none of: shapes are mixed as light is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.keys import Keys
from labrig.design.light import LightProgramme
from labrig.design.material_file import to_material
from labrig.design.nearest import material_radiance
from labrig.design.propagation import SpreadWish, dot_shares
from labrig.design.result import Design
from labrig.design.scene_design import AGAIN, MET, rendered_at_keys
from labrig.design.scene_light import SceneLight
from labrig.design.scene_spectra import SceneSpectra
from labrig.design.search import INSTANT_S
from labrig.design.wish_file import Wish
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.picture_file import read_picture
from labrig.material import Material
from labrig.reproduce import ParameterTexture

#: Strength, as a part of the largest, below which light is none.
FAINTEST = 1e-9
#: Relative difference of albedos that is rounding.
ROUNDED = 1e-9


@dataclass(frozen=True, eq=False)
class BlendedMaterials:
    """Materials in the units of a scene that are blended.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rates, shape (materials, states).
    k_e_per_s
        Excitation rates in 1/s per W m⁻², shape (materials, states, bands of the scene).
    reradiation
        Λ, shape (materials, states, bands of the scene).
    albedo
        Albedo of the last material, shape (bands of the scene,).
    albedo_factor
        Albedo of each material over that of the last, shape (materials,).
    widths_nm
        Widths of the bands, shape (bands of the scene,).
    """

    k_r_per_s: FloatArray
    k_e_per_s: FloatArray
    reradiation: FloatArray
    albedo: FloatArray
    albedo_factor: FloatArray
    widths_nm: FloatArray

    @classmethod
    def of(cls, designs: Sequence[Design], light: SceneSpectra) -> Self:
        """Return the materials of designs; albedos are those of the last times a factor."""
        last = designs[-1].albedo
        squared = float(last @ last)
        factor = [float(each.albedo @ last) / squared if squared > 0 else 1.0 for each in designs]
        return cls(
            np.array([design.k_r_per_s for design in designs]),
            np.array([[light.excitation(k_e) for k_e in each.k_e_per_s] for each in designs]),
            np.array([[light.emission(own) for own in each.reradiation] for each in designs]),
            light.albedo(last),
            np.array(factor),
            np.diff(light.edges_nm),
        )

    def texture(self, shares: FloatArray) -> ParameterTexture:
        """Return the parameters of texels.

        Parameters
        ----------
        shares
            Part of each material, in sum 1, shape (rows, columns, materials).
        """
        k_r = np.exp(shares @ np.log(self.k_r_per_s))
        k_e, emitted = _mixed(self.k_e_per_s, shares), _mixed(self.reradiation, shares)
        factor = shares @ self.albedo_factor
        # Between two materials that keep the energy there may be one that does not.
        allowed = max(1.0, float(self._excess(self.k_e_per_s, self.reradiation,
                                              self.albedo_factor).max()))  # fmt: skip
        excess = self._excess(k_e, emitted, factor) / allowed
        emitted /= np.maximum(excess, 1.0)[..., np.newaxis, np.newaxis]
        is_one = np.allclose(self.albedo_factor, 1.0, rtol=0, atol=ROUNDED)
        return ParameterTexture.checked(k_r, k_e, emitted, None if is_one else factor)

    def _excess(self, k_e: FloatArray, emitted: FloatArray, factor: FloatArray) -> FloatArray:
        """Return what is emitted over what is absorbed in the worst band, without states' bands."""
        energy = np.pi * emitted @ self.widths_nm
        given_back = np.einsum("...s,...sb->...b", energy, k_e)
        absorbed = 1 - factor[..., np.newaxis] * self.albedo
        return np.asarray((given_back / absorbed).max(axis=-1))


def _mixed(spectra: FloatArray, shares: FloatArray) -> FloatArray:
    """Return spectra (rows, columns, states, bands) between those of materials."""
    strength = spectra.sum(axis=-1)
    least = FAINTEST * strength.max(axis=0)
    is_dark = strength <= least
    shape = np.divide(spectra, strength[..., np.newaxis], out=np.zeros_like(spectra),
                      where=~is_dark[..., np.newaxis])  # fmt: skip
    blended = np.exp(shares @ np.log(np.maximum(strength, np.maximum(least, 1e-300))))
    mixed = np.einsum("rcm,msb->rcsb", shares, shape)
    total = mixed.sum(axis=-1, keepdims=True)
    unit = np.divide(mixed, total, out=np.zeros_like(mixed), where=total > 0)
    return np.asarray(blended[..., np.newaxis] * unit)


#: Row and column, from the texture's upper left.
Texel: TypeAlias = tuple[int, int]

#: RMS of relative residuals that nobody sees, up to which a material counts as good as another.
UNSEEN = 2e-3
#: How strongly rates of dots stay as the base's, and rates that do not change at all.
HELD, FIXED = 1e-3, 1e3
#: What is emitted over what is absorbed from which on it is nearly all.
NEARLY_ALL = 0.9
#: Materials of dots that are kept from one wish to the next.
MAX_KEPT = 64
#: Largest albedo of a texel: light has to be lost at every bounce.
MAX_ALBEDO = 0.99


@dataclass(frozen=True, eq=False)
class SpreadDesign:
    """Materials of dots, spread over a surface.

    Attributes
    ----------
    wish
        What was wished for.
    base
        The material of all keys together, which is where no dot reaches.
    of_places
        Material of each place of the wish; places in one texel have one, and one without keys has
        the base.
    shares
        Part of each material in the texels, the last that of the base, shape (rows, columns,
        materials).
    light
        Light in the scene with its albedo.
    spectra
        Spectral light on the places.
    material
        The base in the units of the scene.
    texture
        Parameters of the texels, in place of those of `material`.
    rendered_rgb
        Linear sRGB per sr at the keys in the rendered scene, if it was rendered, shape (keys, 3).
    """

    wish: Wish
    base: Design
    of_places: tuple[Design, ...]
    shares: FloatArray
    light: SceneLight
    spectra: SceneSpectra
    material: Material
    texture: ParameterTexture
    rendered_rgb: FloatArray | None = None

    @cached_property
    def rgb(self) -> FloatArray:
        """Linear sRGB per sr at the keys, as of `Design.got_rgb`, shape (keys, 3)."""
        keys = self.wish.keys
        return self.rgb_at(keys.place, keys.time_s)

    @cached_property
    def delta_e2000(self) -> FloatArray:
        """ΔE2000 of all keys after spreading, shape (keys,)."""
        return self.base.differences_to(self.rgb)

    def rgb_at(self, place: ArrayLike, time_s: ArrayLike) -> FloatArray:
        """Return linear sRGB per sr, reflected light included, in the light of the lamps.

        Parameters
        ----------
        place
            Numbers of places of the wish, shape (n,) or one for all times.
        time_s
            Times in s, shape (n,).

        Returns
        -------
        ndarray
            Linear sRGB over the white per sr, shape (n, 3).
        """
        times = np.asarray(time_s, dtype=np.float64)
        places = np.broadcast_to(np.asarray(place, dtype=np.intp), times.shape)
        found = np.zeros((len(times), 3))
        for number in np.unique(places).tolist():
            own = places == number
            made = self.material_at(self.texel_of(number))
            found[own] = _rgb(made, self.spectra, number, times[own])
        return found

    def rgb_seen(self, x: float, y: float, time_s: ArrayLike) -> FloatArray:
        """Return linear sRGB per sr, as `rgb_at`, of what the picture shows somewhere.

        Parameters
        ----------
        x, y
            As of `SceneLight.place_at`.
        time_s
            Times in s, shape (n,).

        Raises
        ------
        UsageError
            Something else than the material is seen there.
        """
        place = self.light.place_at(x, y)
        made = self.material_at(_texels(self.light, [place])[0])
        times = np.asarray(time_s, dtype=np.float64)
        return _rgb(made, self.light.spectra([place]), 0, times)

    def material_at(self, texel: Texel) -> Material:
        """Return the material of a texel, in the units of the scene."""
        texture, base = self.texture, self.material
        assert texture.k_r_per_s is not None
        assert texture.k_e_per_s is not None
        assert texture.reradiation is not None
        assert base.albedo is not None
        states = tuple(
            state.model_copy(
                update={
                    "k_r_per_s": float(k_r),
                    "k_e_per_s": tuple(k_e.tolist()),
                    "reradiation": tuple(emitted.tolist()),
                }
            )
            for state, k_r, k_e, emitted in zip(
                base.states,
                texture.k_r_per_s[texel],
                texture.k_e_per_s[texel],
                texture.reradiation[texel],
                strict=True,
            )
        )
        albedo = base.albedo
        if texture.albedo_factor is not None:
            factor = float(texture.albedo_factor[texel])
            values = tuple(factor * each for each in albedo.value)
            albedo = albedo.model_copy(update={"value": values})
        return base.model_copy(update={"states": states, "albedo": albedo})

    def rendered(self) -> "SpreadDesign":
        """Return it with what the keys look like where the glow lights its surroundings, too."""
        return replace(self, rendered_rgb=_rendered(self)[0])

    @property
    def rendered_delta_e2000(self) -> FloatArray:
        """ΔE2000 of all keys in the rendered scene, shape (keys,)."""
        assert self.rendered_rgb is not None
        return self.base.differences_to(self.rendered_rgb)

    def under(self, spectra: SceneSpectra) -> "SpreadDesign":
        """Return the materials of the dots that are best in other light, spread as these are."""
        wish = self.wish
        own: dict[Texel, Design] = {}
        for texel, places in _groups(self.light, wish).items():
            before, keys = self.of_places[places[0]], wish.keys.at_places(places)
            albedo = _own_albedo(wish, spectra.programme, self.base, places)
            own[texel] = wish.solve("kept", spectra.programme, before, keys, albedo, held=HELD)
        return _blended(wish, self.base, own, self.shares, self.light, spectra)

    @property
    def notes(self) -> tuple[str, ...]:
        """Why keys of some dots are missed, one sentence each."""
        names, found = self.wish.places, []
        for places in _groups(self.light, self.wish).values():
            own, design = " and ".join(names[each] for each in places), self.of_places[places[0]]
            if len(places) > 1:
                found.append(
                    f"{own} lie in one texel, and share a material; give the object more texels "
                    "(samples)"
                )
            is_spent = design.emitted_over_absorbed_at_most > NEARLY_ALL
            if is_spent and design.cost > _unseen(design.keys):
                found.append(
                    f"{own}: keys are missed where nearly all light that is absorbed is given "
                    "back, so that it can hardly glow brighter"
                )
        return tuple(found)

    def design_at(self, place: int) -> Design:
        """Return the material of a place of the wish, with all keys."""
        return replace(self.of_places[place], keys=self.wish.keys)

    def texel_of(self, place: int) -> Texel:
        """Return row and column, from the texture's upper left, of a place of the wish."""
        return _texels(self.light, self.wish.scene_places)[place]

    def picture(self, t_s: float) -> FloatArray:
        """Return the picture at a time in s, as `SceneLight.picture` does."""
        return self.light.picture(self.material, t_s, self.texture)

    def pictures(self, times_s: Sequence[float]) -> FloatArray:
        """Return rendered pictures at rising times in s, in which the glow lights its surroundings.

        Returns
        -------
        ndarray
            Linear sRGB over the white, shape (times, height, width, 3).
        """
        renderer = self.light.renderer(self.material, self.texture)
        return np.array([self.spectra.rgb(renderer.frame(t_s).radiance) for t_s in times_s])


def solve_spread(wish: Wish, folder: Path = Path()) -> SpreadDesign:
    """Find a material for each dot of a scene, and spread them over the surface.

    What the keys of a dot do not determine is that of the material of all keys together, so that
    neighbours do not differ in it.

    Parameters
    ----------
    wish
        Wish in a scene with `spread`.
    folder
        Folder to which the path of a picture is relative.

    Returns
    -------
    SpreadDesign
        Materials that keep the energy, and the texture of their parameters: the best of up to three
        rounds of rendering, each under the light that the glow itself adds in the one before.

    Raises
    ------
    UsageError
        There is nothing to spread, the surface has no texels, or a picture cannot be read.

    References
    ----------
    X. An, F. Pellacini, *AppProp: all-pairs appearance-space edit propagation* (2008), ACM
    Transactions on Graphics 27.

    Examples
    --------
    >>> from labrig.design import SceneWish, SpreadWish, WishedKey, WishFile, solve_spread, to_wish
    >>> scene = SceneWish(
    ...     file="cornell-box", material="phosphorescent", width_px=16, paths=8, spread=SpreadWish()
    ... )
    >>> file = WishFile(
    ...     scene=scene,
    ...     pixels={"low": (0.1, 0.7), "high": (0.1, 0.3)},
    ...     albedo=0.5,
    ...     keys=(
    ...         WishedKey(at="1 s", place="low", colour=(1e-3, 2e-3, 1e-3)),
    ...         WishedKey(at="1 s", place="high", colour=(1e-3, 1e-3, 2e-3)),
    ...     ),
    ... )
    >>> found = solve_spread(to_wish(file, "mine"))
    >>> found.texture.shape, bool(found.rendered_delta_e2000.max() < 2)
    ((32, 32), True)
    """
    found = Spreading().solve(wish, folder)
    light = found.spectra
    rounds: list[SpreadDesign] = []
    for number in range(1 + AGAIN):
        if number:
            found = found.under(light)
        rgb, light = _rendered(found)
        rounds.append(replace(found, rendered_rgb=rgb))
        if rounds[-1].rendered_delta_e2000.max() < MET:
            break
    return min(rounds, key=lambda each: float((each.rendered_delta_e2000**2).sum()))


def _rendered(found: SpreadDesign) -> tuple[FloatArray, SceneSpectra]:
    """Return linear sRGB at the keys (keys, 3), and the light on the places over time."""
    light = found.light
    renderer = light.renderer(found.material, found.texture)
    places = range(len(found.wish.places))
    albedo = np.array(
        [light.albedo_of(found.material_at(found.texel_of(place))) for place in places]
    )
    return rendered_at_keys(found.wish, light, renderer, albedo, found.spectra)


class Spreading:
    """Solves wishes one after another, and keeps what has not changed from one to the next."""

    def __init__(self) -> None:
        self._key: object = None
        self._shares = np.zeros((0, 0, 0))
        self._found: dict[object, Design] = {}

    def solve(self, wish: Wish, folder: Path = Path()) -> SpreadDesign:
        """Return the design of a wish in the light of the lamps; see `solve_spread`."""
        if wish.scene is None or wish.file.scene is None or wish.file.scene.spread is None:
            raise UsageError("expected a wish in a scene with 'spread', got one without")
        if not wish.keys.count:
            raise UsageError("expected at least one key, got none; say when it should glow how")
        spread = wish.file.scene.spread
        groups = _groups(wish.scene, wish)
        base = _base(wish, self._together(wish, groups))
        light = wish.scene.with_albedo(base.albedo)
        spectra = light.spectra(wish.scene_places)
        if light is not wish.scene:
            base = wish.solve("kept", spectra.programme, near=base, albedo=base.albedo, held=FIXED)
        own = {
            texel: self._own(wish, spectra.programme, base, places)
            for texel, places in groups.items()
        }
        shares = self._spread(wish, light, spread, list(groups), folder)
        found = _blended(wish, base, own, shares, light, spectra)
        if found.texture.albedo_factor is None:
            return found
        return found.under(found.light.spectra(wish.scene_places))

    def _together(self, wish: Wish, groups: Mapping[Texel, Sequence[int]]) -> Design:
        """Return the material of all keys, searched for from that of the dot with most of them."""
        most = max(groups.values(), key=lambda places: wish.keys.at_places(places).count)
        first = self._free(wish, wish.programme, wish.keys.at_places(most), None)
        return first if len(groups) == 1 else wish.solve("kept", near=first)

    def _own(
        self, wish: Wish, programme: LightProgramme, base: Design, places: Sequence[int]
    ) -> Design:
        """Return the material of some places, as near to the base as is as good as any."""
        keys = wish.keys.at_places(places)
        albedo = _own_albedo(wish, programme, base, places)

        def near(design: Design) -> Design:
            return wish.solve("kept", programme, near=design, keys=keys, albedo=albedo, held=HELD)

        nearest = near(base)
        if nearest.cost <= _unseen(keys):
            return nearest
        free = self._free(wish, programme, keys, albedo)
        found = (nearest, near(replace(free, k_e_per_s=base.k_e_per_s)), free)
        best = min(each.cost for each in found)
        return next(each for each in found if each.cost <= best + _unseen(keys))

    def _free(
        self,
        wish: Wish,
        programme: LightProgramme,
        keys: Keys,
        albedo: FloatArray | None,
    ) -> Design:
        """Return the best material of some keys, searched for once while they do not change."""
        given = wish.file.albedo if albedo is None else tuple(albedo.tolist())
        arrays = (keys.place, keys.time_s, keys.radiance, programme.begin_s,
                  programme.irradiance)  # fmt: skip
        key = (wish.file.states, wish.file.weights, wish.file.key_sigma, wish.file.bands_nm, given,
               *(each.tobytes() for each in arrays))  # fmt: skip
        if key not in self._found:
            if len(self._found) >= MAX_KEPT:
                self._found.pop(next(iter(self._found)))
            self._found[key] = wish.solve("kept", programme, keys=keys, albedo=albedo)
        return self._found[key]

    def _spread(
        self,
        wish: Wish,
        light: SceneLight,
        spread: SpreadWish,
        dots: Sequence[Texel],
        folder: Path,
    ) -> FloatArray:
        """Return the part of each dot and of the base in the texels."""
        key = (spread.model_dump_json(), wish.file.pixels, tuple(dots), folder)
        if key != self._key:
            strokes = _strokes(wish, light, spread, dots)
            appearance = _appearance(light, spread, folder)
            of_dots = dot_shares(appearance, dots, strokes, spread)
            rest = 1 - of_dots.sum(axis=-1, keepdims=True)
            self._shares = np.concatenate([of_dots, np.maximum(rest, 0.0)], axis=-1)
            self._key = key
        return self._shares


def _rgb(material: Material, light: SceneSpectra, place: int, time_s: FloatArray) -> FloatArray:
    """Return linear sRGB per sr of a material at times (n,), of one of the lit places."""
    assert material.albedo is not None
    per_band = LightProgramme(light.begin_s, light.irradiance * np.diff(light.edges_nm))
    falling = LightProgramme(light.begin_s, light.irradiance).at(
        np.full(len(time_s), place), time_s
    )
    radiance = material_radiance(material, per_band, place, time_s)
    return light.rgb(radiance + falling * material.albedo.value / np.pi) / np.pi


def _texels(light: SceneLight, places: Sequence[int]) -> list[Texel]:
    """Return row and column of places of the material."""
    rows, columns = light.texels.texels_of(light.places[list(places)])
    return list(zip(rows.tolist(), columns.tolist(), strict=True))


def _groups(light: SceneLight, wish: Wish) -> dict[Texel, list[int]]:
    """Return the places with keys by their texels: two of one texel share a material."""
    groups: dict[Texel, list[int]] = {}
    for place, texel in enumerate(_texels(light, wish.scene_places)):
        if (wish.keys.place == place).any():
            groups.setdefault(texel, []).append(place)
    return groups


def _base(wish: Wish, free: Design) -> Design:
    """Return the material of all keys together, from the one that meets them best.

    Where dots differ none meets them, and what it takes to miss them least is no guide for those
    of the dots: then all light excites alike, and fills a good part of the states.
    """
    light = wish.programme.irradiance.max(axis=(0, 1))
    if free.cost <= _unseen(wish.keys) or not light.any():
        return free
    time_s = max(float(wish.keys.time_s.max() - wish.programme.begin_s[0]), INSTANT_S)
    plain = np.where(light > 0, 1 / (light.sum() * time_s), 0.0)
    near = replace(free, k_e_per_s=np.tile(plain, (free.n_states, 1)))
    return wish.solve("kept", near=near, held=FIXED)


def _unseen(keys: Keys) -> float:
    """Return the sum of squared residuals that nobody sees."""
    return UNSEEN**2 * keys.radiance.size


def _own_albedo(
    wish: Wish, programme: LightProgramme, base: Design, places: Sequence[int]
) -> FloatArray:
    """Return the albedo of some places: that of the base, of another brightness if keys tell it."""
    if not isinstance(wish.file.albedo, str):
        return base.albedo
    free = wish.solve("kept", programme, near=base, keys=wish.keys.at_places(places))
    known = [each.is_determined for each in free.estimates if each.name.startswith("albedo")]
    squared = float(base.albedo @ base.albedo)
    if not (all(known) and squared > 0):
        return base.albedo
    factor = float(free.albedo @ base.albedo) / squared
    return base.albedo * min(factor, MAX_ALBEDO / float(base.albedo.max()))


def _blended(
    wish: Wish,
    base: Design,
    own: Mapping[Texel, Design],
    shares: FloatArray,
    light: SceneLight,
    spectra: SceneSpectra,
) -> SpreadDesign:
    """Return materials spread over the surface."""
    texture = BlendedMaterials.of([*own.values(), base], spectra).texture(shares)
    of_places = tuple(own.get(each, base) for each in _texels(light, wish.scene_places))
    material = to_material(base, wish.file.name, spectra)
    if texture.albedo_factor is not None:
        light = light.with_texture(material, texture)
    return SpreadDesign(wish, base, of_places, shares, light, spectra, material, texture)


def _strokes(
    wish: Wish, light: SceneLight, spread: SpreadWish, dots: Sequence[Texel]
) -> list[BoolArray]:
    """Return the texels that are painted for each dot."""
    names = dict(zip(wish.places, _texels(light, wish.scene_places), strict=True))
    painted = [np.zeros(light.texels.shape, np.bool_) for _ in dots]
    for name, strokes in spread.strokes.items():
        if names[name] not in dots:
            continue
        for x, y, radius in strokes:
            painted[dots.index(names[name])] |= light.texels_under(x, y, radius)
    return painted


def _appearance(light: SceneLight, spread: SpreadWish, folder: Path) -> FloatArray:
    """Return what makes texels alike: the material, and the colours of a picture if there is one.

    Shape (rows, columns, n).
    """
    materials = light.texels.materials
    alike = [materials == each for each in np.unique(materials)]
    channels = np.stack(alike, axis=-1).astype(np.float64)
    if spread.appearance_file is None:
        return channels
    return np.concatenate(
        [channels, _colours(folder / spread.appearance_file, light.texels.shape)], axis=-1
    )


def _colours(path: Path, shape: tuple[int, int]) -> FloatArray:
    """Return the colours of a picture as a screen shows them, 0 to 1, (rows, columns, 3)."""
    import cv2

    picture = read_picture(path, "for 'appearance_file'")
    rows, columns = shape
    resized = cv2.resize(picture, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(resized, dtype=np.float64) / 255
