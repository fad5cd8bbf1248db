"""Light on a material that is designed in a scene: traced once, and kept.

What a design changes is the glow and the albedo of one material; the paths of light between all
surfaces stay. The light that falls on the material follows from them for each lamp, so that another
light programme costs nothing, and another albedo one fold of the paths.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.design.bands import DesignBands, three_bands
from labrig.design.light import LightProgramme
from labrig.design.result import Design
from labrig.design.scene_spectra import SceneSpectra, checked_edges
from labrig.foundation.arrays import BoolArray, Float32Array, FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import did_you_mean
from labrig.material import Material
from labrig.reproduce import (
    Bands,
    Field,
    FieldParameters,
    ParameterTexture,
    ProgrammeEntry,
    Renderer,
    Scene,
    Surface,
    SurfaceMaterial,
    build_scene,
    of_phosphor,
    read_scene,
)


@dataclass(frozen=True, eq=False)
class TexelSurface:
    """Texels of an object, top row first as in a picture of its texture.

    Attributes
    ----------
    surface
        The object.
    first_place
        Number of its first place among all of the scene.
    material
        Number of the material that is spread.
    """

    surface: Surface
    first_place: int
    material: int

    @classmethod
    def of(cls, scene: Scene, material: str) -> Self:
        """Return the only object of a material.

        Raises
        ------
        UsageError
            Several objects are made of it, or the only one has no texels.
        """
        number = list(scene.file.materials).index(material)
        found, first = [], 0
        for surface in scene.surfaces(scene.file.programme[0].at_s):
            own = surface.material_of_texel
            is_own = surface.material == number if own is None else (own == number).any()
            if is_own:
                found.append(cls(surface, first, number))
            first += surface.n_places
        if len(found) != 1:
            names = ", ".join(each.surface.name for each in found)
            raise UsageError(
                f"{scene.file.name}: expected one object of '{material}' to spread over, got "
                f"{len(found)} ({names}); give the others a material of their own"
            )
        if not isinstance(found[0].surface.samples, tuple):
            raise UsageError(
                f"{scene.file.name}: expected texels on '{found[0].surface.name}' to spread over "
                f"(samples: [columns, rows]), got {found[0].surface.samples}"
            )
        return found[0]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        assert isinstance(self.surface.samples, tuple)
        columns, rows = self.surface.samples
        return rows, columns

    @property
    def materials(self) -> Int32Array:
        """Number of the material of each texel (rows, columns)."""
        own = self.surface.material_of_texel
        return np.full(self.shape, self.material) if own is None else own[::-1]

    def texels_of(self, places: Int32Array) -> tuple[Int32Array, Int32Array]:
        """Return rows and columns of places, which are numbers among all of the scene."""
        rows, columns = self.shape
        row, column = np.divmod(places - self.first_place, columns)
        return rows - 1 - row, column


#: Albedo of the material before it is designed.
PLACEHOLDER = 0.5
#: Places whose light stands for that of all in spectra of a design.
TYPICAL = 8
#: Times at which the glow of other phosphors is kept.
MAX_KEPT = 256
#: Half of the diagonal of a pixel.
HALF_PIXEL = 0.5**0.5


@dataclass(frozen=True, eq=False)
class SceneLight:
    """The light on one material of a scene where nothing moves.

    Attributes
    ----------
    scene
        The scene, with a placeholder in place of the material.
    material
        Name of the material to be designed.
    bands
        Bands of the design.
    white_cd_per_m2
        Luminance of the white, which is 1, 1, 1 in linear sRGB.
    albedo
        Albedo of the placeholder, shape (bands,).
    """

    scene: Scene
    material: str
    bands: DesignBands
    white_cd_per_m2: float
    albedo: FloatArray
    _renderer: Renderer = field(repr=False)
    _of_lamps: FloatArray = field(repr=False)

    @classmethod
    def of(
        cls,
        scene: str | Path,
        material: str,
        *,
        white_cd_per_m2: float | None = None,
        bands: DesignBands | None = None,
        programme: Sequence[ProgrammeEntry] | None = None,
        albedo: ArrayLike = PLACEHOLDER,
        width_px: int | None = None,
        paths: int | None = None,
        threads: int | None = None,
    ) -> Self:
        """Trace a scene, and return the light on one of its materials.

        Parameters
        ----------
        scene
            Scene file, or the name of a shipped scene.
        material
            Name of the material to be designed.
        white_cd_per_m2
            Luminance of the white. Default: that of a white card at the brightest place of the
            material under the strongest light of the programme.
        bands
            Bands of the design, each of whole bands of the scene. Default: three channels.
        programme
            Levels of the lamps over time instead of the scene's.
        albedo
            Albedo of the material before it is designed, one or one for each band.
        width_px
            Width of the picture; its height follows.
        paths
            Paths for each pixel and each place.
        threads
            Threads that trace and fold. Default: one for each processor.

        Raises
        ------
        UsageError
            The scene moves, has no such material, or does not show it; the material does not begin
            empty; or the light has no colour that three channels hold.

        Examples
        --------
        >>> from labrig.design import SceneLight
        >>> light = SceneLight.of("cornell-box", "phosphorescent", width_px=16, paths=4)
        >>> light.programme([light.place_at(0.1, 0.6)]).begin_s.tolist()
        [-600.0, 0.0]
        """
        chosen = three_bands() if bands is None else bands
        built = _placed(scene, material, chosen, width_px, paths)
        if programme is not None:
            built = built.with_programme(programme)
        _require_colours(built, chosen)
        renderer = Renderer(built, threads)
        own = renderer.places_of(material)
        if not np.isin(own, renderer.seen_places).any():
            raise UsageError(
                f"{built.file.name}: expected a material that can be seen, got '{material}', which "
                "is nowhere in the picture; choose another, or turn the camera"
            )
        of_lamps = renderer.irradiance_of_lamps()[:, own]
        light = cls(built, material, chosen, 1.0, np.zeros(chosen.count), renderer, of_lamps)
        white = light._white() if white_cd_per_m2 is None else white_cd_per_m2
        if not white > 0:
            raise UsageError(
                f"{built.file.name}: no light that an eye sees falls on '{material}'; give the "
                "luminance of the white (white_cd_per_m2)"
            )
        return replace(light, white_cd_per_m2=white).with_albedo(albedo)

    def with_albedo(self, albedo: ArrayLike) -> Self:
        """Return the light with another albedo of the material; no path is traced.

        Parameters
        ----------
        albedo
            Albedo, one or one for each band of the design, 0 to 1.
        """
        given = np.broadcast_to(np.asarray(albedo, dtype=np.float64), (self.bands.count,))
        if not ((given >= 0) & (given <= 1)).all():
            raise UsageError(f"expected an albedo from 0 to 1, got {given.tolist()}")
        if (given == self.albedo).all():
            return self
        reflected = np.diag(self._typical.albedo(given)).astype(np.float32)
        return self._on(self.scene.with_material(self.material, _dark(reflected)), given.copy())

    def with_programme(self, programme: Sequence[ProgrammeEntry]) -> Self:
        """Return the light with other levels of the lamps over time; no path is traced."""
        scene = self.scene.with_programme(programme)
        _require_colours(scene, self.bands)
        renderer = Renderer(scene, traced=self._renderer)
        return replace(self, scene=scene, _renderer=renderer)

    def _on(self, scene: Scene, albedo: FloatArray) -> Self:
        renderer = Renderer(scene, traced=self._renderer)
        of_lamps = renderer.irradiance_of_lamps()[:, self.places]
        return replace(self, scene=scene, albedo=albedo, _renderer=renderer, _of_lamps=of_lamps)

    @property
    def n_places(self) -> int:
        """Number of places of the material."""
        return len(self.places)

    def place_at(self, x: float, y: float) -> int:
        """Return the place of the material that the picture shows somewhere.

        Parameters
        ----------
        x, y
            Where, as fractions of the picture's width and height from its upper left, 0 to 1.

        Raises
        ------
        UsageError
            Something else is seen there, which is named.
        """
        if not (0 <= x <= 1 and 0 <= y <= 1):
            raise UsageError(
                f"expected a point of the picture, 0 to 1 from its upper left, got {x:g}, {y:g}"
            )
        seen = self._renderer.seen_at(x, y)
        if seen.material != self.material:
            of = f" of '{seen.material}'" if seen.material is not None else ""
            raise UsageError(
                f"expected a point on '{self.material}', got {x:g}, {y:g}, where {seen.name}{of} "
                "is seen"
            )
        return int(np.flatnonzero(self.places == seen.place)[0])

    def spectra(self, places: Sequence[int]) -> SceneSpectra:
        """Return the spectral light on some places of the material, by lamps and all reflections.

        Parameters
        ----------
        places
            Numbers of places, as `place_at` returns them.

        Raises
        ------
        UsageError
            Three channels cannot hold the light that surfaces send there.
        """
        found = self._of_programme(places)
        if self.bands.edges_nm is None and not found.fits_three_channels:
            raise UsageError(
                f"{self.scene.file.name}: expected light whose colour is within linear sRGB for a "
                f"design in three channels, got other light on '{self.material}', which comes from "
                "surfaces around it; give bands_nm"
            )
        return found

    def programme(self, places: Sequence[int]) -> LightProgramme:
        """Return the light on some places of the material, in the bands and white of the design."""
        return self.spectra(places).programme

    def with_texture(self, material: Material, texture: ParameterTexture) -> Self:
        """Return the light with the albedo of a material and its texture; no path is traced."""
        surface = self._measured(material, texture)
        return self._on(self.scene.with_material(self.material, surface), self.albedo)

    def picture(
        self,
        material: Material | Design | None,
        t_s: float,
        texture: ParameterTexture | None = None,
    ) -> FloatArray:
        """Return the picture with a material, its own glow on other surfaces included.

        Levels are those that the stored light charges. The light between surfaces is complete, but
        the glow does not charge.

        Parameters
        ----------
        material
            The material; None shows the placeholder, which does not glow.
        t_s
            Time in s.
        texture
            Parameters of each texel that take the place of those of a `Material`.

        Returns
        -------
        ndarray
            Linear sRGB over the white, shape (height, width, 3).
        """
        glow = self._others.at(t_s).copy()
        renderer = self._renderer
        if material is not None:
            surface = self._surface(material, texture)
            renderer = self._with(surface)
            glow[self.places] = self._glow(surface, t_s)
        unit = np.pi / self._typical.unit_w_per_m2_nm
        to_rgb = unit * self._typical.to_rgb
        return renderer.colours(glow, self.scene.levels(t_s), to_rgb).astype(np.float64)

    def renderer(self, material: Material, texture: ParameterTexture | None = None) -> Renderer:
        """Return a renderer of the scene with a material, on the paths that are kept.

        Parameters
        ----------
        material
            The material.
        texture
            Parameters of each texel that take the place of the material's.

        Raises
        ------
        UsageError
            The material lacks something, or would glow ever more.
        """
        return self._with(self._measured(material, texture))

    @cached_property
    def places(self) -> Int32Array:
        """Numbers of the material's places among all of the scene, shape (places,)."""
        return self._renderer.places_of(self.material)

    def albedo_of(self, material: Material) -> FloatArray:
        """Return the albedo of a material in the bands of the scene."""
        return np.diagonal(self._measured(material).matrix).astype(np.float64)

    @cached_property
    def texels(self) -> TexelSurface:
        """The object of the material, over whose texels parameters are spread.

        Raises
        ------
        UsageError
            Several objects are made of it, or it has no texels.
        """
        return TexelSurface.of(self.scene, self.material)

    def texels_under(self, x: float, y: float, radius: float) -> BoolArray:
        """Return the texels of the material that a round stroke on the picture covers.

        Parameters
        ----------
        x, y
            Its middle, as fractions of the picture's width and height from its upper left.
        radius
            Its radius as a fraction of the picture's height.

        Returns
        -------
        ndarray
            Whether a texel is covered, top row first, shape (rows, columns).
        """
        places = self._renderer.first_places
        height, width = places.shape[:2]
        row, column = np.indices((height, width))
        across, down = (column + 0.5 - x * width) / height, (row + 0.5) / height - y
        # Even the finest stroke covers what its own pixel shows.
        found = places[np.hypot(across, down) <= max(radius, HALF_PIXEL / height)]
        covered = np.zeros(self.texels.shape, np.bool_)
        covered[self.texels.texels_of(np.intersect1d(found, self.places))] = True
        return covered

    def _with(self, surface: SurfaceMaterial) -> Renderer:
        scene = self.scene.with_material(self.material, surface)
        return Renderer(scene, traced=self._renderer)

    @cached_property
    def _others(self) -> "_OtherGlow":
        return _OtherGlow(self.scene, self._renderer)

    def _of_programme(self, places: Sequence[int]) -> SceneSpectra:
        parts = self.scene.file.programme
        levels = np.stack([self.scene.levels(part.at_s) for part in parts])
        light = np.einsum("tl,lpb->ptb", levels, self._of_lamps[:, list(places)])
        return self._spectra(np.array([part.at_s for part in parts]), light)

    def _spectra(self, begin_s: FloatArray, light: FloatArray) -> SceneSpectra:
        edges = self.scene.bands.edges_nm
        return SceneSpectra(begin_s, light, edges, self.bands, self.white_cd_per_m2)

    @cached_property
    def _typical(self) -> SceneSpectra:
        """Light of each lamp that is ever on, on places from the darkest to the brightest."""
        light = self._of_lamps[_used(self.scene)]
        order = np.argsort(light.sum(axis=(0, 2)))
        order = order[light[:, order].any(axis=(0, 2))]
        some = order[np.linspace(0, len(order) - 1, TYPICAL).round().astype(int)]
        return self._spectra(np.arange(float(len(light))), light[:, some].swapaxes(0, 1))

    def _white(self) -> float:
        """Return the luminance of a card at the brightest place under the strongest light."""
        light = self._of_programme(range(self.n_places))
        return float(light.rgb(light.irradiance / np.pi)[..., 1].max(initial=0.0))

    def _surface(
        self, material: Material | Design, texture: ParameterTexture | None = None
    ) -> SurfaceMaterial:
        """Return a material in the bands of the scene."""
        if isinstance(material, Material):
            return self._measured(material, texture)
        light, widths_nm = self._typical, self.scene.bands.width_nm
        parameters = FieldParameters.checked(
            material.k_r_per_s,
            [light.excitation(k_e) * widths_nm for k_e in material.k_e_per_s],
            [light.emission(emitted) for emitted in material.reradiation],
            material.order,
        )
        reflected = np.diag(light.albedo(material.albedo)).astype(np.float32)
        return SurfaceMaterial("design", reflected, parameters)

    def _measured(
        self, material: Material, texture: ParameterTexture | None = None
    ) -> SurfaceMaterial:
        entry, scene = self.scene.file.materials[self.material], self.scene
        albedo, scale = entry.assume_albedo, entry.assume_scale
        return of_phosphor(material, scene.bands, scene.bench_light, albedo, scale, texture=texture)

    def _glow(self, surface: SurfaceMaterial, t_s: float) -> Float32Array:
        """Return the radiance that the material emits at a time (places, bands)."""
        assert surface.parameters is not None
        parameters = surface.parameters
        if surface.texture is not None:
            uv = self.texels.surface.uv_of_places
            assert uv is not None
            own = surface.texture.texel_at(uv[self.places - self.texels.first_place])
            parameters = parameters.at(own)
        states = Field(parameters, self.n_places)
        begin = [part.at_s for part in self.scene.file.programme if part.at_s < t_s]
        for first, last in pairwise([*begin, t_s]):
            light = np.tensordot(self.scene.levels(first), self._of_lamps, 1)
            states.step(light.T, last - first)
        return np.asarray(states.radiance().T)


class _OtherGlow:
    """Glow of the other phosphors of a scene, whose levels are stepped once."""

    def __init__(self, scene: Scene, traced: Renderer) -> None:
        self._scene, self._traced = scene, traced
        self._kept: dict[float, Float32Array] = {}
        self._renderer = Renderer(scene, traced=traced)

    def at(self, t_s: float) -> Float32Array:
        """Return the radiance that places emit by themselves at a time (places, bands)."""
        if t_s not in self._kept:
            if len(self._kept) >= MAX_KEPT:
                self._kept.pop(next(iter(self._kept)))
            if t_s < self._renderer.t_s:
                self._renderer = Renderer(self._scene, traced=self._traced)
            if t_s > self._renderer.t_s:
                self._renderer.advance(t_s)
            self._kept[t_s] = self._renderer.emitted()
        return self._kept[t_s]


def _placed(
    name_or_path: str | Path,
    material: str,
    bands: DesignBands,
    width_px: int | None,
    paths: int | None,
) -> Scene:
    """Return the scene with a placeholder in place of the material."""
    file, folder = read_scene(name_or_path)
    if material not in file.materials:
        raise UsageError(
            f"{file.name}: there is no material '{material}'; "
            f"{did_you_mean(material, list(file.materials))}"
        )
    if file.is_moving:
        raise UsageError(
            f"{file.name}: expected a scene where nothing moves, got one that does; design in a "
            "still one, and render the material in this one"
        )
    entry = file.materials[material]
    if entry.levels != 0 or entry.prompt:
        raise UsageError(
            f"{file.name}: expected '{material}' to begin empty, without 'levels' and 'prompt'; "
            "let the programme charge it"
        )
    scene_bands = Bands.even(file.bands.first_nm, file.bands.last_nm, file.bands.count)
    checked_edges(bands, scene_bands.edges_nm)
    grey = np.diag(np.full(len(scene_bands), PLACEHOLDER)).astype(np.float32)
    scene = build_scene(file, folder, made={material: _dark(grey)})
    camera = file.camera
    height_px = (
        None if width_px is None else max(1, round(width_px * camera.height_px / camera.width_px))
    )
    return scene.resized(width_px, height_px, paths)


def _dark(reflected: Float32Array) -> SurfaceMaterial:
    """Return a material that has states, but neither light charges them nor do they glow."""
    nothing = np.zeros((1, len(reflected)))
    parameters = FieldParameters.checked([1.0], nothing, nothing)
    return SurfaceMaterial("placeholder", reflected, parameters)


def _used(scene: Scene) -> NDArray[np.bool_]:
    """Return which lamps are ever on (lamps,)."""
    levels = [scene.levels(part.at_s) for part in scene.file.programme]
    return np.asarray(np.any(np.array(levels) > 0, axis=0))


def _require_colours(scene: Scene, bands: DesignBands) -> None:
    """Refuse darkness, and lamps that three channels cannot hold."""
    if not _used(scene).any():
        raise UsageError(f"{scene.file.name}: expected a lamp that shines at some time, got none")
    if bands.edges_nm is not None:
        return
    for lamp, is_used in zip(scene.lamps(0.0), _used(scene), strict=True):
        if not (is_used and lamp.light.any()):
            continue
        light = lamp.light[np.newaxis, np.newaxis]
        if not SceneSpectra(
            np.zeros(1), light, scene.bands.edges_nm, bands, 1.0
        ).fits_three_channels:
            raise UsageError(
                f"{scene.file.name}: expected lamps whose colour is within linear sRGB for a "
                f"design in three channels, got '{lamp.name}'; give bands_nm"
            )
