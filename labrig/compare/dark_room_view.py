"""The dark room as a rendered scene: its size, and the light in the middle of each sample."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.output_file import make_folder, write_text
from labrig.foundation.region import Region, region_pixels
from labrig.foundation.yaml_file import yaml_text
from labrig.material import Material, ReradiationMatrix, write_fluorescent, write_material
from labrig.optics import Spectrum
from labrig.reduce import SensorLayout
from labrig.reproduce import CARD_NAME, DarkRoomPicture, Renderer, Scene, SceneFile
from labrig.results import write_csv

#: Height of the frame in the rendering; its light is even on every sample.
HEIGHT_PX, MOST_PX = 32, 512
#: Name of the scene's file.
SCENE_FILE = "dark-room.yaml"


@dataclass(frozen=True, eq=False)
class DarkRoomScene:
    """The dark room of a run as a scene of `labrig render`.

    Attributes
    ----------
    file
        The scene, with pictures under the lamp and of the glow.
    materials
        Materials by the names under which the scene names their files.
    lights
        Spectra of lamps that are files of the scene's own, by the names of these.
    """

    file: SceneFile
    materials: Mapping[str, Material | ReradiationMatrix]
    lights: Mapping[str, Spectrum] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Write scene, materials and lights into a folder, and return the path of the scene."""
        make_folder(folder)
        for name, material in self.materials.items():
            if isinstance(material, Material):
                write_material(folder / name, material)
            else:
                write_fluorescent(folder / name, material)
        for name, light in self.lights.items():
            pairs = zip(light.wavelength_nm, light.value, strict=True)
            rows = [(f"{nm:.9g}", f"{value:.9g}") for nm, value in pairs]
            write_csv(folder / name, ("wavelength_nm", "value"), rows)
        path = folder / SCENE_FILE
        content = self.file.model_dump(mode="json", exclude_none=True)
        write_text(path, yaml_text(content))
        return path


def fractions_of(region: Region, layout: SensorLayout) -> Region:
    """Return a region in fractions of the frame."""
    x, y, wide, high = region_pixels(region, layout.width, layout.height)
    return (x / layout.width, y / layout.height, wide / layout.width, high / layout.height)


def picture_of(layout: SensorLayout) -> DarkRoomPicture:
    """Return a small picture with the aspect of a sensor."""
    aspect = layout.width / layout.height
    width_px = min(max(round(HEIGHT_PX * aspect), 1), MOST_PX)
    return DarkRoomPicture(width_px, max(round(width_px / aspect), 8))


def rendered_light(
    scene: Scene, regions: Mapping[str, Region], picture: DarkRoomPicture, times_s: FloatArray
) -> dict[float, dict[str, FloatArray]]:
    """Return the spectral radiance (bands,) of each sample, and of the card, by time in s."""
    renderer = Renderer(scene, threads=1)
    pixels = {name: _pixel(region, picture) for name, region in regions.items()}
    if CARD_NAME in scene.file.objects:
        pixels[CARD_NAME] = (-1, picture.width_px // 2)
    rows, columns = np.transpose(list(pixels.values()))
    seen = {}
    for t_s in times_s.tolist():
        radiance = renderer.frame(t_s).radiance[rows, columns]
        seen[t_s] = dict(zip(pixels, radiance, strict=True))
    return seen


def _pixel(region: Region, picture: DarkRoomPicture) -> tuple[int, int]:
    """Return row and column of the pixel in the middle of a region."""
    x, y, wide, high = region
    return int((y + high / 2) * picture.height_px), int((x + wide / 2) * picture.width_px)
