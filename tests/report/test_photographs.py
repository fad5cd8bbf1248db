"""Pictures of frames of every kind of sensor. Oracle: the scene that the test wrote."""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from labrig.optics import read_camera, srgb_bytes
from labrig.report.colours import screen_for
from labrig.report.photographs import daylight_picture, glow_pictures
from labrig.report.report_model import GlowPhotograph
from tests.reduce.conftest import _dng as write_dng

from .made import decay_series, frame, patch

BLACK, WHITE = 1000, 15000
HEIGHT, WIDTH = 288, 384
#: A JPEG's colours are off by some steps of 255.
ROUNDED = 8.0
#: Lit is the middle of the upper left quarter: rows, columns.
LIT = (slice(36, 108), slice(48, 144))
RGB = {"R": 2400.0, "G": 6000.0, "B": 1200.0, "L": 6000.0}
X_TRANS = "GGRGGBGGBGGRBRGRBGGGBGGRGGRGGBRBGBRG"


@dataclass(frozen=True)
class Sensor:
    name: str
    cfa: str
    levels: int = 1

    @property
    def cell(self) -> int:
        """Side of what becomes a pixel."""
        return max(2, _side(self.cfa))

    @property
    def colours(self) -> npt.NDArray[np.float64]:
        """R, G, B as parts of the range above black, brightest 1."""
        light, room = self._light(), WHITE - self._black()
        names = "LLL" if self.cfa == "L" else "RGB"
        seen = [np.mean((light / room)[light == RGB[name]]) for name in names]
        return np.asarray(seen / np.max(seen))

    def write(self, path: Path, light: float = 1.0, clipped: bool = False) -> Path:
        """Photograph the scene, with noise; `clipped`: one pixel of each cell."""
        mosaic = self._black() + np.random.default_rng(1).normal(0, 3, (HEIGHT, WIDTH))
        mosaic[LIT] += light * self._light()[LIT]
        if clipped:
            mosaic[LIT][:: self.cell, :: self.cell] = WHITE
        path.write_bytes(write_dng(np.rint(mosaic), self.cfa, self._black_levels(), WHITE))
        return path

    def _light(self) -> npt.NDArray[np.float64]:
        return _tiled([RGB[colour] for colour in self.cfa])

    def _black_levels(self) -> tuple[float, ...]:
        return tuple(BLACK + 40.0 * n for n in range(self.levels))

    def _black(self) -> npt.NDArray[np.float64]:
        return _tiled(self._black_levels())


def _side(pattern: Sequence[object]) -> int:
    return round(math.sqrt(len(pattern)))


def _tiled(values: Sequence[float]) -> npt.NDArray[np.float64]:
    side = _side(values)
    tile = np.reshape(values, (side, side)).astype(float)
    return np.tile(tile, (HEIGHT // side, WIDTH // side))


SENSORS = [
    Sensor("Bayer", "RGGB", 4),
    Sensor("another Bayer", "GBRG", 4),
    Sensor("quad Bayer", "RRGGRRGGGGBBGGBB", 4),
    Sensor("X-Trans", X_TRANS),
    Sensor("X-Trans, 36 black levels", X_TRANS, 36),
    Sensor("monochrome", "L"),
    Sensor("monochrome, 4 black levels", "L", 4),
]
every_sensor = pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)


def shown(source: str) -> npt.NDArray[np.float64]:
    """Pixels of a data URI, R, G, B."""
    data = base64.b64decode(source.removeprefix("data:image/jpeg;base64,"))
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture[:, :, ::-1].astype(float)


def middle(picture: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Mean colour of the middle of what is lit, which must be where it was."""
    height, width, _ = picture.shape
    y, x = height // 4, width // 4
    dark = picture.copy()
    dark[height // 10 : height * 4 // 10, width // 10 : width * 4 // 10] = 0
    assert dark.max() < 40, "nothing else is lit"
    return np.asarray(picture[y - 2 : y + 2, x - 2 : x + 2].mean(axis=(0, 1)))


@every_sensor
def test_the_daylight_photograph_has_the_colours_and_the_place(
    sensor: Sensor, tmp_path: Path
) -> None:
    day = frame(sensor.write(tmp_path / "1.dng"), 1, "daylight")
    picture = daylight_picture([day], [patch(decay_series())], screen_for(None))
    assert picture is not None
    assert abs(picture.height - HEIGHT / sensor.cell) <= 2, "LibRaw may leave out a cell"
    assert abs(picture.width - WIDTH / sensor.cell) <= 2
    (mark,) = picture.marks
    assert (mark.x, mark.y) == pytest.approx((picture.width / 4, picture.height / 4), abs=1)
    expected = srgb_bytes(0.8 * sensor.colours).astype(float)
    assert middle(shown(picture.source)) == pytest.approx(expected, abs=ROUNDED)
    grey = sensor.cfa == "L"
    assert ("from a monochrome sensor" if grey else "in raw colours") in picture.caption


@every_sensor
def test_pictures_of_the_glow_are_on_one_scale_and_brightened(
    sensor: Sensor, tmp_path: Path
) -> None:
    glow = [
        GlowPhotograph(frame(sensor.write(tmp_path / "1.dng"), 1), 0.5),
        GlowPhotograph(frame(sensor.write(tmp_path / "2.dng", light=0.1), 2), 60.0),
        # half the light, exposed for twice as long
        GlowPhotograph(frame(sensor.write(tmp_path / "3.dng"), 3, exposure_s=2.0), 5.0),
    ]
    pictures = glow_pictures(glow, screen_for(None))
    assert [picture.t_s for picture in pictures] == [0.5, 60.0, 5.0]
    colours = sensor.colours
    for picture, light in zip(pictures, (1.0, 0.1, 0.5), strict=True):
        as_it_is = srgb_bytes(light * colours).astype(float)
        assert middle(shown(picture.source)) == pytest.approx(as_it_is, abs=ROUNDED)
        brightened = shown(picture.brightened_source)
        y, x = (side // 4 for side in brightened.shape[:2])
        found = brightened[y - 2 : y + 2, x - 2 : x + 2].mean(axis=(0, 1))
        assert found == pytest.approx(srgb_bytes(colours).astype(float), abs=ROUNDED)
        assert float(picture.brightened) == pytest.approx(1 / light, rel=0.05)
        assert not picture.has_saturation


@every_sensor
def test_a_saturated_colour_is_white_and_reported(sensor: Sensor, tmp_path: Path) -> None:
    clipped = frame(sensor.write(tmp_path / "1.dng", clipped=True), 1)
    (picture,) = glow_pictures([GlowPhotograph(clipped, 0.5)], screen_for(None))
    assert picture.has_saturation
    assert middle(shown(picture.source)) == pytest.approx([255.0] * 3, abs=2)


def test_a_monochrome_sensor_is_grey_even_where_a_camera_is_named(tmp_path: Path) -> None:
    screen = screen_for(read_camera("canon_eos_5d_mark_ii"))
    path = Sensor("monochrome", "L").write(tmp_path / "1.dng")
    day = daylight_picture([frame(path, 1, "daylight")], [], screen)
    (glow,) = glow_pictures([GlowPhotograph(frame(path), 0.5)], screen)
    assert day is not None
    for source in (day.source, glow.source, glow.brightened_source):
        red, green, blue = middle(shown(source))
        assert green > 200
        assert max(abs(red - green), abs(blue - green)) <= 2
    assert "from a monochrome sensor" in day.caption
