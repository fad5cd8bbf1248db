"""The file that says how something should glow: a light programme and keys."""

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.design.bands import XYZ_TO_RGB, DesignBands, spectral_bands, three_bands
from labrig.design.keys import Keys
from labrig.design.light import LightProgramme
from labrig.design.propagation import SpreadWish
from labrig.design.result import Design
from labrig.design.search import PREFERENCE
from labrig.design.solver import KEY_SIGMA, MAX_STATES, solve
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import WISH, require_kind
from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive, UnitFraction
from labrig.foundation.named_files import beside
from labrig.foundation.quantity import DurationS, Fraction, TimeS
from labrig.foundation.yaml_file import did_you_mean, read_model
from labrig.material import MAX_ORDER
from labrig.optics import read_light
from labrig.reproduce import ProgrammeEntry

# A scene is traced only if a file names one.
if TYPE_CHECKING:
    from labrig.design.scene_light import SceneLight


#: Name of the place of a file that names none.
ONLY_PLACE = "patch"
DARKNESS = "none"
#: sRGB's curve, IEC 61966-2-1: end of its straight part, slope, offset and exponent.
LINEAR_END, LINEAR_SLOPE, OFFSET, EXPONENT = 0.04045, 12.92, 0.055, 2.4
HEX = re.compile(r"#[0-9a-fA-F]{6}")


class LightChange(FrozenModel):
    """Light that falls on a place from one time until the next.

    Attributes
    ----------
    at
        Time from which the light is on, for example `10 s`.
    light
        Name of the light: `none`, a CIE illuminant such as `D65`, a wavelength such as `365nm`, or
        a file with a spectrum.
    strength
        Luminance of a white card under the light, in the unit in which a card under D65 of
        strength 1 is the white of a screen. Of a light that no eye sees it is the energy over that
        of D65.
    irradiance
        Instead of `light`: irradiance in every band, or in linear R, G, B; 1, 1, 1 is D65 of
        strength 1.
    """

    at: DurationS
    light: Annotated[str, Field(min_length=1)] | None = None
    strength: NotNegative = 1.0
    irradiance: tuple[NotNegative, ...] | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.light is None) == (self.irradiance is None):
            raise ValueError("expected 'light' or 'irradiance', got both or neither")
        return self


class WishedKey(FrozenModel):
    """How a place should look at a time, reflected light included.

    Attributes
    ----------
    at
        Time, on the clock of the light or the scene, for example `11 s`; `-1 s` is before its zero.
    place
        Name of the place. Default: the only one.
    colour
        Colour of a screen such as `"#20c060"`, or linear R, G, B, where 1, 1, 1 is a white card
        under D65 of strength 1.
    xyz
        Instead of `colour`: X, Y, Z, with Y = 1 for that white card.
    spectrum
        Instead of `colour`: light in every band, in which a white card gives the irradiance.
    brightness
        Factor of the colour: a glow is far darker than a screen.
    """

    at: TimeS
    place: Annotated[str, Field(min_length=1)] | None = None
    colour: str | tuple[Finite, Finite, Finite] | None = None
    xyz: tuple[NotNegative, NotNegative, NotNegative] | None = None
    spectrum: tuple[NotNegative, ...] | None = None
    brightness: NotNegative = 1.0

    @model_validator(mode="after")
    def _one_colour(self) -> Self:
        given = [self.colour, self.xyz, self.spectrum]
        if sum(each is not None for each in given) != 1:
            raise ValueError("expected one of 'colour', 'xyz' and 'spectrum', got none or several")
        if isinstance(self.colour, str) and not HEX.fullmatch(self.colour):
            raise ValueError(f"expected a colour such as '#20c060', got '{self.colour[:20]}'")
        return self

    def rgb(self) -> FloatArray:
        """Return the colour in linear sRGB, a white card being 1; not of a spectrum."""
        if self.xyz is not None:
            return self.brightness * (XYZ_TO_RGB @ self.xyz)
        if isinstance(self.colour, str):
            coded = np.array([int(self.colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
            curved = ((coded + OFFSET) / (1 + OFFSET)) ** EXPONENT
            linear = np.where(coded <= LINEAR_END, coded / LINEAR_SLOPE, curved)
            return self.brightness * np.asarray(linear)
        return self.brightness * np.array(self.colour)


class SceneWish(FrozenModel):
    """Scene in which a material is designed.

    Attributes
    ----------
    file
        Name of a shipped scene, or a scene file, its path relative to this file.
    material
        Name of the material of the scene that is to be designed.
    white_cd_per_m2
        Luminance of the white, which is 1, 1, 1. Default: that of a white card at the brightest
        place of the material under the strongest light.
    programme
        Which lamps shine when, instead of the scene's.
    width_px
        Width of the picture. Default: the scene's.
    paths
        Paths of light for each pixel and each place of the material. Default: the scene's.
    spread
        That every dot has a material of its own, and how they are spread over the surface. Default:
        one material for all dots.
    """

    file: Annotated[str, Field(min_length=1)]
    material: Annotated[str, Field(min_length=1)]
    white_cd_per_m2: Positive | None = None
    programme: tuple[ProgrammeEntry, ...] | None = None
    width_px: Annotated[int, Field(ge=1, le=8192)] | None = None
    paths: Annotated[int, Field(ge=1, le=65536)] | None = None
    spread: SpreadWish | None = None


class WishFile(FrozenModel):
    """How something should glow under which light.

    Attributes
    ----------
    name
        Name of the material to be found.
    bands_nm
        Edges of bands of wavelengths in nm, rising. Default: the three channels of linear sRGB.
    states
        Number of excited states, 1 or 2.
    order
        Kinetic order of the states, 1 to 4, or `free`.
    albedo
        Albedo, one number or one for each band, or `free`.
    weights
        How keys count: `luminance`, relative to their own luminance, so that faint ones count;
        `plain`, by their squared differences as they are.
    key_sigma
        How exactly a key is meant, for example `2 %`: the parameters' σ belong to it.
    light
        Light programme of the only place. Before its first time all is dark.
    places
        Instead of `light`: a light programme for each of several places, by name.
    scene
        Instead of `light`: a scene in which the material is designed.
    pixels
        Places of the scene, by name: where its picture shows them, as fractions of its width and
        height from its upper left.
    keys
        How it should look when; none yet is no wish to be solved, but one to go on with.
    """

    name: Annotated[str, Field(min_length=1)] = "design"
    bands_nm: tuple[Positive, ...] | None = None
    states: Annotated[int, Field(ge=1, le=MAX_STATES)] = 1
    order: Annotated[float, Field(ge=1, le=MAX_ORDER)] | Literal["free"] = 1.0
    albedo: UnitFraction | tuple[UnitFraction, ...] | Literal["free"] = "free"
    weights: Literal["luminance", "plain"] = "luminance"
    key_sigma: Annotated[Fraction, Field(gt=0, lt=1)] = KEY_SIGMA
    light: tuple[LightChange, ...] | None = None
    places: dict[str, tuple[LightChange, ...]] | None = None
    scene: SceneWish | None = None
    pixels: dict[str, tuple[UnitFraction, UnitFraction]] | None = None
    keys: tuple[WishedKey, ...] = ()

    @model_validator(mode="after")
    def _has_light(self) -> Self:
        given = [name for name in ("light", "places", "scene") if getattr(self, name) is not None]
        if len(given) != 1:
            got = " and ".join(f"'{name}'" for name in given) or "none"
            raise ValueError(f"expected one of 'light', 'places' and 'scene', got {got}")
        if self.scene is None and self.pixels is not None:
            raise ValueError("expected 'pixels' beside 'scene' only")
        if self.scene is not None and self.keys and not self.pixels:
            raise ValueError("expected 'pixels', the places of the keys in the scene, got none")
        if self.scene is not None and self.scene.spread is not None:
            self._check_spread(self.scene.spread)
        for name, changes in self.programmes.items():
            if not changes:
                raise ValueError(f"expected at least one light of '{name}', got none")
            if any(b.at <= a.at for a, b in itertools.pairwise(changes)):
                raise ValueError(f"expected rising times in the light of '{name}', got others")
        if self.scene is None and not self.programmes:
            raise ValueError("expected at least one of 'places', got none")
        return self

    def _check_spread(self, spread: SpreadWish) -> None:
        if self.order != 1:
            raise ValueError(
                f"expected 'order: 1' beside 'spread', whose rates differ from texel to texel, got "
                f"{self.order}"
            )
        pixels = self.pixels or {}
        for name in spread.strokes:
            if name not in pixels:
                raise ValueError(
                    f"the strokes of 'spread' are for '{name}'; {did_you_mean(name, list(pixels))}"
                )

    @property
    def programmes(self) -> Mapping[str, tuple[LightChange, ...]]:
        """Light programmes by the places' names; none of a scene."""
        if self.places is not None:
            return self.places
        return {} if self.light is None else {ONLY_PLACE: self.light}


@dataclass(frozen=True, eq=False)
class Wish:
    """A wish in the form in which it is solved.

    Attributes
    ----------
    file
        What was read.
    bands, programme, keys
        Arguments of `solve`.
    places
        Names of the places, in the programme's order.
    scene
        Light in the scene, if there is one, with the albedo that the file gives.
    scene_places
        Numbers of the places in the scene.
    """

    file: WishFile
    bands: DesignBands
    programme: LightProgramme
    keys: Keys
    places: tuple[str, ...]
    scene: "SceneLight | None" = None
    scene_places: tuple[int, ...] = ()

    def solve(
        self,
        energy: Literal["free", "kept"] = "free",
        programme: LightProgramme | None = None,
        near: Design | None = None,
        keys: Keys | None = None,
        albedo: FloatArray | None = None,
        held: float = PREFERENCE,
    ) -> Design:
        """Return the material that meets the wish best.

        Parameters
        ----------
        energy, near, held
            As of `solve`.
        programme
            Light on the places instead of the wish's.
        keys
            Some of the keys instead of all.
        albedo
            Albedo of each band instead of the wish's, shape (bands,).
        """
        file = self.file
        given = None if isinstance(file.albedo, str) else file.albedo
        return solve(
            self.programme if programme is None else programme,
            self.keys if keys is None else keys,
            self.bands,
            n_states=file.states,
            order=None if isinstance(file.order, str) else file.order,
            albedo=given if albedo is None else albedo,
            weights=file.weights,
            key_sigma=file.key_sigma,
            energy=energy,
            near=near,
            held=held,
        )

    def solve_kept(self) -> tuple[Design, Design]:
        """Return the material that meets the wish best, and the best that keeps the energy."""
        best = self.solve()
        return best, best if best.keeps_energy else self.solve("kept")


def read_wish(path: Path) -> Wish:
    """Read how something should glow from a YAML file.

    Parameters
    ----------
    path
        Path of the file; its keys are described by `labrig schema design`.

    Returns
    -------
    Wish
        Light programme and keys.

    Raises
    ------
    UsageError
        The file is malformed, names an unknown place or light, or its keys contradict each other.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.design import read_wish
    >>> text = '''
    ... light: [{at: 0 s, light: D65}, {at: 10 s, light: none}]
    ... keys: [{at: 11 s, colour: "#20c060", brightness: 0.02}]
    ... '''
    >>> _ = Path("wish.yaml").write_text(text)
    >>> read_wish(Path("wish.yaml")).keys.radiance.round(5).tolist()
    [[9e-05, 0.00336, 0.00074]]
    """
    require_kind(path, WISH)
    return to_wish(read_model(path, WishFile), str(path), path.parent)


def to_wish(
    file: WishFile, source: str, folder: Path = Path(), light: "SceneLight | None" = None
) -> Wish:
    """Return a wish in the form in which it is solved.

    Parameters
    ----------
    file
        What was read.
    source
        Name of its source, for messages.
    folder
        Folder to which the path of a scene is relative.
    light
        Light of the scene, by the lamps and with the albedo of the file, if it was traced before.

    Returns
    -------
    Wish
        Light programme and keys.

    Raises
    ------
    UsageError
        Numbers of bands disagree, a place or a light is not known, or keys contradict each other.

    Examples
    --------
    >>> from labrig.design import LightChange, WishedKey, WishFile, to_wish
    >>> light = (LightChange(at="0 s", light="D65"), LightChange(at="9 s", light="none"))
    >>> file = WishFile(light=light, keys=(WishedKey(at="10 s", colour=(0, 0.01, 0)),))
    >>> to_wish(file, "mine").programme.irradiance[0].round(2).tolist()
    [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]
    """
    try:
        bands = three_bands() if file.bands_nm is None else spectral_bands(file.bands_nm)
        if not isinstance(file.albedo, str | float) and len(file.albedo) != bands.count:
            raise UsageError(f"expected an albedo of {bands.count} bands, got {len(file.albedo)}")
        if file.scene is not None:
            traced = light or _traced(file, file.scene, bands, folder)
            return _in_scene(file, bands, traced)
        places = tuple(file.programmes)
        programme = _programme(file, bands)
        keys = _keys(file, places, bands)
    except UsageError as error:
        raise UsageError(f"{source}: {error}") from None
    return Wish(file, bands, programme, keys, places)


def _in_scene(file: WishFile, bands: DesignBands, light: "SceneLight") -> Wish:
    pixels = file.pixels or {}
    keys = _keys(file, tuple(pixels), bands)
    numbers = tuple(light.place_at(x, y) for x, y in pixels.values())
    return Wish(file, bands, light.programme(numbers), keys, tuple(pixels), light, numbers)


def _traced(file: WishFile, wish: SceneWish, bands: DesignBands, folder: Path) -> "SceneLight":
    from labrig.design.scene_light import PLACEHOLDER, SceneLight

    return SceneLight.of(
        beside(wish.file, folder),
        wish.material,
        white_cd_per_m2=wish.white_cd_per_m2,
        bands=bands,
        programme=wish.programme,
        albedo=PLACEHOLDER if isinstance(file.albedo, str) else file.albedo,
        width_px=wish.width_px,
        paths=wish.paths,
    )


def _programme(file: WishFile, bands: DesignBands) -> LightProgramme:
    """Return the programmes of all places on one grid of times."""
    begin = sorted({change.at for changes in file.programmes.values() for change in changes})
    irradiance = np.zeros((len(file.programmes), len(begin), bands.count))
    for place, changes in enumerate(file.programmes.values()):
        for change in changes:
            # Until the next change, which overwrites what follows it.
            irradiance[place, begin.index(change.at) :] = _irradiance(change, bands)
    return LightProgramme.checked(begin, irradiance)


def _irradiance(change: LightChange, bands: DesignBands) -> FloatArray:
    if change.irradiance is not None:
        if len(change.irradiance) != bands.count:
            raise UsageError(
                f"expected an irradiance of {bands.count} bands at {change.at:g} s, got "
                f"{len(change.irradiance)}"
            )
        return change.strength * np.array(change.irradiance)
    assert change.light is not None
    if change.light == DARKNESS:
        return np.zeros(bands.count)
    return bands.light(read_light(change.light), change.strength)


def _keys(file: WishFile, places: tuple[str, ...], bands: DesignBands) -> Keys:
    if not file.keys:
        return Keys.none()
    kinds = {key.spectrum is None for key in file.keys}
    if len(kinds) > 1:
        raise UsageError("expected keys that are all colours or all spectra, got both")
    wanted, where = [], []
    for number, key in enumerate(file.keys, start=1):
        if key.spectrum is None:
            wanted.append(key.rgb())
        elif len(key.spectrum) != bands.count:
            raise UsageError(
                f"expected a spectrum of {bands.count} bands in key {number}, got "
                f"{len(key.spectrum)}"
            )
        else:
            wanted.append(key.brightness * np.array(key.spectrum))
        if key.place is None and len(places) > 1:
            raise UsageError(f"expected a place of key {number}; known: {', '.join(places)}")
        name = places[0] if key.place is None else key.place
        if name not in places:
            raise UsageError(f"key {number} is at '{name}'; {did_you_mean(name, places)}")
        where.append(places.index(name))
    # The radiance of a white card is its irradiance over π.
    radiance = np.array(wanted).reshape(len(wanted), -1) / np.pi
    return Keys.checked(where, [key.at for key in file.keys], radiance)
