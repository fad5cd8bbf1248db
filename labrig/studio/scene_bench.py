"""Answers to the page about a material in a scene: its picture, and designs for dots on it."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from pydantic import Field

from labrig.design import (
    PLACEHOLDER,
    RGB_TO_Y,
    Design,
    Keys,
    SceneDesign,
    SceneLight,
    SceneSpectra,
    SceneWish,
    SpreadDesign,
    Spreading,
    Wish,
    WishFile,
    solve_in_scene,
    spectral_bands,
    three_bands,
    to_wish,
)
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_PICTURE_BYTES, read_bytes
from labrig.foundation.models import Finite, UnitFraction
from labrig.foundation.yaml_file import validate
from labrig.material import Material, material_text
from labrig.optics import srgb_bytes
from labrig.report import describe_energy, draw_scene_design
from labrig.reproduce import load_scene, read_scene, write_parameter_texture
from labrig.studio.messages import (
    SOURCE,
    Asked,
    parameters_content,
    spread_answer,
    wish_content,
)
from labrig.studio.workbench import Designed, Workbench

#: Width of the picture, and paths for each of its pixels and each place: answered while a dot is
#: dragged.
WIDTH_PX, PATHS = 192, 16
#: Name of the place that is shown before a dot is set.
BRIGHTEST = "brightest place"
#: Lights of one bands, programme and albedo that are kept.
MAX_LIGHTS = 4
#: Albedo of the material at first.
ALBEDO = 0.6
#: Percentile of the picture's luminance that automatic exposure shows so bright.
PERCENTILE, EXPOSED = 97.0, 0.7
#: Bands of the scene that are one of the design, where three channels do not hold its lamps.
MERGED = 2


class PictureAsked(Asked):
    """A picture that the page asks for.

    Attributes
    ----------
    t_s
        Time in s.
    exposure_ev
        Exposure in stops; None to follow the glow.
    """

    t_s: Finite
    exposure_ev: Annotated[float, Field(ge=-60, le=60)] | None = None


class PointAsked(Asked):
    """A point of the picture that the page asks about.

    Attributes
    ----------
    x, y
        Fractions of the picture's width and height from its upper left.
    t_s
        Time in s.
    """

    x: UnitFraction
    y: UnitFraction
    t_s: Finite


@dataclass(frozen=True)
class Picture:
    """A picture of the scene.

    Attributes
    ----------
    png
        Content of its file.
    exposure
        Factor from colours to those of the screen.
    """

    png: bytes
    exposure: float


@dataclass(frozen=True)
class Size:
    """Fineness with which a scene is traced, and its white in cd/m², None by the scene."""

    width_px: int
    paths: int
    white: float | None


class SceneBench(Workbench):
    """What answers a page about a material in a scene, whose light is traced once.

    Parameters
    ----------
    scene
        Scene file, or the name of a shipped scene.
    material
        Name of the material to be designed; None for the only one that glows.
    width_px, paths
        Width of the picture, and paths for each of its pixels and each place.
    folder
        Folder to which the path of a picture of the surface is relative.

    Raises
    ------
    UsageError
        The scene is malformed or moves, or does not say which material is meant.
    """

    def __init__(
        self,
        scene: str,
        material: str | None = None,
        folder: Path = Path(),
        width_px: int = WIDTH_PX,
        paths: int = PATHS,
    ) -> None:
        self._folder = folder
        self._spreading = Spreading()
        self._spread: tuple[str, SpreadDesign] | None = None
        super().__init__()
        self._scene = str(Path(scene).resolve()) if Path(scene).suffix else scene
        self._material = material or _only_glowing(scene)
        self._size = Size(width_px, paths, None)
        self._traced_lights: dict[object, SceneLight] = {}
        self._lights: dict[object, SceneLight] = {}
        self._again: tuple[str, SceneDesign] | None = None
        self._edges_nm, first = self._first()
        self._size = Size(width_px, paths, first.white_cd_per_m2)
        self._built = first.scene

    def _first(self) -> tuple[tuple[float, ...] | None, SceneLight]:
        """Return the bands that hold the lamps' colours, three or some of wavelengths, and light.

        Of lamps that no eye sees nothing says what white is: 1 cd/m².
        """
        entry = read_scene(self._scene)[0].bands
        step_nm = (entry.last_nm - entry.first_nm) / entry.count
        edges = tuple(
            entry.first_nm + MERGED * step_nm * n for n in range(entry.count // MERGED + 1)
        )
        tried: list[tuple[tuple[float, ...] | None, float | None]]
        tried = [(None, None), (edges, None), (edges, 1.0)]
        for number, (bands_nm, white) in enumerate(tried):
            try:
                return bands_nm, self._traced(bands_nm, replace(self._size, white=white))
            except UsageError as error:
                is_about_light = "bands_nm" in str(error) or "white_cd_per_m2" in str(error)
                if not is_about_light or number == len(tried) - 1:
                    raise
        raise AssertionError("the last try returns or raises")

    def start(self) -> dict[str, Any]:
        """Return the wish with which a page begins: the scene and its light, and no dot."""
        content = {
            "name": self._material,
            "albedo": ALBEDO,
            "bands_nm": self._edges_nm,
            "scene": {
                "file": self._scene,
                "material": self._material,
                "white_cd_per_m2": self._size.white,
                "programme": [part.model_dump() for part in self._built.file.programme],
                "width_px": self._size.width_px,
                "paths": self._size.paths,
            },
            "pixels": {},
        }
        return wish_content(validate(content, WishFile, SOURCE))

    def take(self, file: WishFile, source: str) -> dict[str, Any]:
        """Return the wish of a file, with what it leaves to the scene written out.

        Raises
        ------
        UsageError
            It is malformed, or of another scene or material.
        """
        content = super().take(file, source)
        content["scene"] = self.start()["scene"] | content["scene"] | {"file": self._scene}
        return content

    def look(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the material that meets the wishes, and what the page has to know of the scene."""
        asked = Asked.of(content)
        if (spread := self._spread_of(asked)) is not None:
            found, wish = spread_answer(spread), spread.wish
        else:
            found, wish = super().look(content), self.design(content).wish
        assert wish.scene is not None
        camera = wish.scene.scene.file.camera
        return found | {
            "scene": {
                "material": self._material,
                "lamps": list(self._built.file.lamps),
                "width_px": camera.width_px,
                "height_px": camera.height_px,
            },
            "is_rendered_again": self._found_again(asked) is not None,
        }

    def picture_of_scene(self, content: Mapping[str, Any]) -> Picture:
        """Return the picture of the scene with a material at a time.

        Raises
        ------
        UsageError
            The message or the wish is malformed.
        """
        asked = validate(content, PictureAsked, SOURCE)
        about = _without_question(content)
        if (spread := self._spread_of(Asked.of(about))) is not None:
            rgb = spread.picture(asked.t_s)
        else:
            design, wish, _ = self.design(about)
            assert wish.scene is not None
            rgb = wish.scene.picture(design, asked.t_s)
        if asked.exposure_ev is not None:
            exposure = 2.0**asked.exposure_ev
        else:
            bright = float(np.percentile(rgb @ RGB_TO_Y, PERCENTILE))
            exposure = EXPOSED / bright if bright > 0 else 1.0
        good, png = cv2.imencode(".png", srgb_bytes(exposure * rgb)[..., ::-1])
        assert good
        return Picture(png.tobytes(), exposure)

    def seen(self, content: Mapping[str, Any]) -> list[float]:
        """Return the colour of the material at a point of the picture.

        Raises
        ------
        UsageError
            Something else is seen there.
        """
        asked = validate(content, PointAsked, SOURCE)
        about = _without_question(content)
        if (spread := self._spread_of(Asked.of(about))) is not None:
            return [float(x) for x in np.pi * spread.rgb_seen(asked.x, asked.y, [asked.t_s])[0]]
        design, wish, _ = self.design(about)
        assert wish.scene is not None
        place = wish.scene.place_at(asked.x, asked.y)
        there = replace(design, programme=wish.scene.programme([place]))
        return [float(x) for x in np.pi * there.rgb_at(0, [asked.t_s])[0]]

    def again(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Design again in the light that the glow itself adds, and render the scene with it.

        The answer has the parameters found; a question with them gets that material.
        """
        asked = Asked.of(content)
        if (spread := self._spread_of(asked)) is not None:
            residuals = spread.rendered().rendered_delta_e2000
            line = (
                f"Rendered: ΔE2000 {float(residuals.max()):.1f} at most, "
                f"{float(residuals.mean()):.1f} in the mean"
            )
            return {"lines": [line], "parameters": None}
        found = solve_in_scene(self._wish(asked.file(), SOURCE))
        lines = [
            f"Round {number}: ΔE2000 {float(each.max()):.1f} at most, {float(each.mean()):.1f} in "
            f"the mean{', which is kept' if number == found.best + 1 else ''}"
            for number, each in enumerate(found.rounds, start=1)
        ]
        if cost := describe_energy(found.wished, found.kept):
            lines.append(cost.removeprefix("! "))
        by_hand = parameters_content(found.design)
        same = Asked.of({"wish": asked.wish, "by_hand": by_hand})
        self._again, self._last = (same.model_dump_json(exclude={"is_draft"}), found), None
        return {"lines": lines, "parameters": by_hand}

    def _found_again(self, asked: Asked) -> SceneDesign | None:
        """Return the design in its own light, if the page asks for that."""
        is_it = self._again is not None and self._again[0] == asked.model_dump_json(
            exclude={"is_draft"}
        )
        return self._again[1] if is_it and self._again is not None else None

    def _designed(self, asked: Asked) -> Designed:
        found = self._found_again(asked)
        if found is None:
            return super()._designed(asked)
        return Designed(found.design, found.wish, None)

    def _light_of(self, wish: Wish) -> SceneSpectra | None:
        assert wish.scene is not None
        return wish.scene.spectra(wish.scene_places)

    def material(self, content: Mapping[str, Any]) -> str:
        """Return the text of the material file; of several materials that of all keys together."""
        spread = self._spread_of(Asked.of(content))
        return super().material(content) if spread is None else material_text(spread.material)

    def texture(self, content: Mapping[str, Any]) -> bytes:
        """Return the file of the texture of materials that are spread over the surface.

        Raises
        ------
        UsageError
            One material is asked for, or no dot has a key.
        """
        spread = self._spread_of(Asked.of(content))
        if spread is None:
            raise UsageError("expected keys of dots with a material each, got one material for all")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "texture.npz"
            write_parameter_texture(path, spread.texture)
            return read_bytes(path, MAX_PICTURE_BYTES)

    def picture(self, content: Mapping[str, Any]) -> bytes:
        """Return a figure of a design over time as a PNG."""
        spread = self._spread_of(Asked.of(content))
        if spread is None:
            return super().picture(content)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "design.png"
            draw_scene_design(spread.rendered(), path)
            return read_bytes(path, MAX_PICTURE_BYTES)

    def _spread_of(self, asked: Asked) -> SpreadDesign | None:
        """Return the materials of dots; None where one is for all, or there is no key."""
        file = asked.file()
        is_one = file.scene is None or file.scene.spread is None
        if is_one or asked.by_hand is not None or not file.keys:
            return None
        key, last = asked.model_dump_json(), self._spread
        if last is None or last[0] != key:
            wish = self._wish(file, SOURCE)
            last = self._spread = key, self._spreading.solve(wish, self._folder)
        return last[1]

    def _wish(self, file: WishFile, source: str) -> Wish:
        if file.scene is None:
            raise UsageError(
                f"{source}: expected keys in a scene, got some on patches; design there: labrig "
                "design --open FILE"
            )
        # A file that was moved names its scene by a path that is not there any more.
        is_same = Path(file.scene.file).name == Path(self._scene).name
        if not is_same or file.scene.material != self._material:
            raise UsageError(
                f"{source}: expected '{self._material}' of {self._scene}, got "
                f"'{file.scene.material}' of {file.scene.file}; design it there: labrig design "
                f"{file.scene.file} --material {file.scene.material} --open FILE"
            )
        light = self._light_for(file, file.scene)
        if file.pixels:
            return to_wish(file, source, light=light)
        everywhere = light.programme(range(light.n_places)).irradiance
        brightest = int(everywhere.sum(axis=(1, 2)).argmax())
        programme = light.programme([brightest])
        return Wish(file, light.bands, programme, Keys.none(), (BRIGHTEST,), light, (brightest,))

    def _light_for(self, file: WishFile, scene: SceneWish) -> SceneLight:
        """Return the light in the bands and white, by the lamps and with the albedo of a wish."""
        albedo = PLACEHOLDER if isinstance(file.albedo, str) else file.albedo
        size = Size(
            scene.width_px or self._size.width_px,
            scene.paths or self._size.paths,
            scene.white_cd_per_m2 or self._size.white,
        )

        def lit() -> SceneLight:
            light = self._traced(file.bands_nm, size)
            if scene.programme is not None:
                light = light.with_programme(scene.programme)
            return light.with_albedo(albedo)

        return _kept(
            self._lights, (file.bands_nm, scene.model_dump_json(exclude={"spread"}), albedo), lit
        )

    def _traced(self, edges_nm: tuple[float, ...] | None, size: Size) -> SceneLight:
        """Return the light by the scene's own lamps."""

        def traced() -> SceneLight:
            return SceneLight.of(
                self._scene,
                self._material,
                white_cd_per_m2=size.white,
                bands=three_bands() if edges_nm is None else spectral_bands(edges_nm),
                width_px=size.width_px,
                paths=size.paths,
            )

        return _kept(self._traced_lights, (edges_nm, size), traced)

    def _material_of(self, design: Design, wish: Wish) -> Material:
        if self._again is not None and self._again[1].design is design:
            return self._again[1].material
        return super()._material_of(design, wish)


def _kept(
    lights: dict[object, SceneLight], key: object, make: Callable[[], SceneLight]
) -> SceneLight:
    """Return light that was made before, or make it; the oldest is forgotten."""
    if key not in lights:
        made = make()
        while len(lights) >= MAX_LIGHTS:
            lights.pop(next(iter(lights)))
        lights[key] = made
    return lights[key]


def _without_question(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a message without what only one question has."""
    return {key: value for key, value in content.items() if key in Asked.model_fields}


def _only_glowing(scene: str) -> str:
    """Return the name of the only material of a scene that phosphoresces."""
    built = load_scene(scene)
    names = [
        name
        for name, made in zip(built.file.materials, built.materials, strict=True)
        if made.parameters is not None
    ]
    if len(names) != 1:
        raise UsageError(
            f"{built.file.name}: expected the name of the material to be designed (--material), "
            f"one of {', '.join(names or built.file.materials)}"
        )
    return names[0]
