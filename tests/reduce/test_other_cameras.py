"""Sensors that are not an even-cornered Bayer one. Oracle: the mosaic that the test wrote.

No NEF, ARW, RAF or monochrome file is among the real photographs: DNG files stand for them, as
Adobe's converter makes them of all of these.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from labrig.foundation.errors import DataError, FrameError
from labrig.reduce import RawFrame, SeriesFrame, hot_pixels, measure, read_raw, reduce_series

WriteDng = Callable[..., bytes]
MakeRaw = Callable[..., RawFrame]

X_TRANS = "GGRGGBGGBGGRBRGRBGGGBGGRGGRGGBRBGBRG"
QUAD = "RRGGRRGGGGBBGGBB"
LEVEL = {"R": 3000.0, "G": 6000.0, "B": 2000.0, "L": 4000.0}
HEIGHT, WIDTH = 150, 186
ACTIVE_AREA, MASKED_AREAS, BLACK_BY_COLUMN, LAYOUT = 50829, 50830, 50715, 50711


def _tiled(values: Sequence[Any], shape: tuple[int, int], corner: tuple[int, int]) -> Any:
    """`values`, repeating over the sensor from `corner`, for each pixel."""
    rows, columns = shape
    y = (np.arange(HEIGHT) - corner[0]) % rows
    x = (np.arange(WIDTH) - corner[1]) % columns
    return np.reshape(values, shape)[np.ix_(y, x)]


def _square(values: Sequence[Any]) -> tuple[int, int]:
    side = round(len(values) ** 0.5)
    return side, side


@dataclass(frozen=True)
class Sensor:
    name: str
    cfa: str
    black: tuple[float, ...] = (1000.0,)
    repeat: tuple[int, int] | None = None
    area: tuple[int, int, int, int] = (0, 0, HEIGHT, WIDTH)
    make: str = "labrig"
    model: str = "test"
    masked: bool = False
    inside: bool = False

    @property
    def corner(self) -> tuple[int, int]:
        return self.area[:2]

    @property
    def colours(self) -> Any:
        return _tiled(list(self.cfa), self.repeat or _square(self.cfa), self.corner)

    def mosaic(self) -> npt.NDArray[np.uint16]:
        """Light of `LEVEL` with photon noise, each pixel on its own black level, 500 outside."""
        level = np.vectorize(LEVEL.get)(self.colours).astype(float)
        black = _tiled(self.black, _square(self.black), self.corner)
        count_levels = np.rint(np.random.default_rng(5).poisson(level) + black)
        top, left, bottom, right = self.area
        seen = np.full(count_levels.shape, 500.0)
        seen[top:bottom, left:right] = count_levels[top:bottom, left:right]
        return seen.astype(np.uint16)

    def dng(self, write: WriteDng) -> bytes:
        tags = [(ACTIVE_AREA, "I", 4, self.area)]
        if self.masked:
            tags.append((MASKED_AREAS, "I", 4, (0, 0, HEIGHT, self.area[1])))
        return write(
            self.mosaic(), self.cfa, self.black, repeat=self.repeat, tags=tags,
            make=self.make, model=self.model, inside=self.inside,
        )  # fmt: skip


FOUR = (1000.0, 1100.0, 1200.0, 1300.0)
ODD = (3, 5, 149, 183)
SENSORS = [
    Sensor("Bayer", "RGGB", FOUR),
    *(Sensor(f"Bayer, odd corner, {cfa}", cfa, FOUR, area=ODD) for cfa in ("RGGB", "GRBG")),
    Sensor("odd top", "BGGR", FOUR, area=(1, 4, 150, 186)),
    Sensor("odd left", "GBRG", FOUR, area=(2, 7, 150, 186)),
    Sensor("masked border", "RGGB", (1024.0,), area=(4, 12, 150, 186), masked=True),
    Sensor("masked border, odd corner", "RGGB", FOUR, area=ODD, masked=True),
    Sensor("black levels are fractions", "RGGB", (1000.5, 1000.25, 1001.0, 1002.75)),
    Sensor("in a sub-image", "RGGB", FOUR, area=ODD, inside=True),
    Sensor("NEF", "RGGB", (1008.0,), make="NIKON CORPORATION", model="NIKON Z 6", area=ODD),
    Sensor("ARW", "RGGB", (512.0,), make="SONY", model="ILCE-7M3", area=ODD),
    Sensor("RAF, Bayer", "RGGB", (1022.0,), make="FUJIFILM", model="X-T100", area=ODD),
    Sensor("X-Trans", X_TRANS),
    Sensor("X-Trans, odd corner", X_TRANS, area=ODD),
    Sensor("X-Trans, 36 black levels", X_TRANS, tuple(1000.0 + 5 * i for i in range(36)), area=ODD),
    Sensor("RAF, X-Trans", X_TRANS, make="FUJIFILM", model="X-T2", area=ODD),
    Sensor("Bayer, 9 black levels", "RGGB", tuple(1000.0 + 20 * i for i in range(9)), area=ODD),
    Sensor("quad Bayer", QUAD, FOUR, area=ODD),
    Sensor("a rectangle of colours", "RGGBGRBG", repeat=(4, 2), area=ODD),
    Sensor("monochrome", "L", area=ODD, masked=True),
    Sensor("monochrome, 4 black levels", "L", FOUR, area=ODD),
]


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_every_sensor_reads_as_its_mosaic(write_dng: WriteDng, sensor: Sensor) -> None:
    raw = read_raw(sensor.dng(write_dng))
    mosaic = sensor.mosaic()
    # LibRaw may begin some pixels inside the active area, never outside.
    y, x = _place(raw, mosaic)
    top, left, bottom, right = sensor.area
    assert top <= y < top + 6
    assert left <= x < left + 6
    assert (y + raw.height, x + raw.width) == (bottom, right)
    own = (slice(y, y + raw.height), slice(x, x + raw.width))
    times = (-(-raw.height // raw.cfa_side), -(-raw.width // raw.cfa_side))
    for found, written in (
        (list(raw.cfa), sensor.colours),
        (raw.black, _tiled(sensor.black, _square(sensor.black), sensor.corner)),
    ):
        tile = np.reshape(found, (raw.cfa_side, raw.cfa_side))
        assert np.array_equal(np.tile(tile, times)[: raw.height, : raw.width], written[own])
    channels = measure(raw).channels
    assert tuple(channels) == (("L",) if sensor.cfa == "L" else ("R", "G", "B"))
    for name, stats in channels.items():
        assert stats.mean == pytest.approx(LEVEL[name], abs=4 * stats.sigma)
        # Nothing but photon noise: σ of a mean is √(level / n).
        assert stats.sigma == pytest.approx(np.sqrt(LEVEL[name] / stats.n), rel=0.2)
        assert (stats.saturated, stats.hot) == (0, 0)
    assert sum(stats.n for stats in channels.values()) == raw.mosaic.size


def _place(raw: RawFrame, mosaic: npt.NDArray[np.uint16]) -> tuple[int, int]:
    """Where the visible part lies on the sensor."""
    for y in range(HEIGHT - raw.height + 1):
        for x in range(WIDTH - raw.width + 1):
            if np.array_equal(mosaic[y : y + raw.height, x : x + raw.width], raw.mosaic):
                return y, x
    raise AssertionError("the visible part is not a part of the mosaic")


@pytest.mark.parametrize(("cfa", "side"), [(X_TRANS, 6), (QUAD, 4), ("L", 1), ("RGGB", 2)])
@pytest.mark.parametrize("region", [None, (31, 22, 60, 49), (7, 3, 12, 12)])
def test_a_region_of_any_pattern(
    make_raw: MakeRaw, cfa: str, side: int, region: tuple[int, int, int, int] | None
) -> None:
    rng = np.random.default_rng(4)
    colours = _tiled(list(cfa), (side, side), (0, 0))
    pixels = 1000 + rng.poisson(np.vectorize(LEVEL.get)(colours).astype(float))
    hot, clipped = (40, 50), (9, 10)
    pixels[hot], pixels[clipped] = 30000, 60000
    raw = make_raw(pixels, cfa=cfa)
    x, y, width, height = region or (0, 0, WIDTH, HEIGHT)
    area = (slice(y, y + height), slice(x, x + width))
    measured = measure(raw, region)
    mask = np.zeros(pixels.shape, bool)
    mask[hot] = mask[clipped] = True
    masked = measure(raw, region, hot=mask)
    for name, stats in measured.channels.items():
        mine = np.zeros(pixels.shape, bool)
        mine[area] = colours[area] == name
        assert stats.n == np.count_nonzero(mine)
        assert stats.mean == pytest.approx(pixels[mine].mean() - 1000, rel=1e-12)
        assert stats.std == pytest.approx(pixels[mine].std(ddof=1), rel=1e-9)
        assert stats.saturated == int(mine[clipped])
        assert stats.hot == int(mine[hot]) + int(mine[clipped])
        clean = masked.channels[name]
        assert (clean.hot, clean.saturated) == (0, 0)
        assert clean.n == stats.n - stats.hot
        assert clean.sigma == pytest.approx(np.sqrt(LEVEL[name] / clean.n), rel=0.25)
    assert measured.to_json()["cfa"] == cfa
    assert measured.to_json()["black"] == [1000.0] * len(cfa)


@pytest.mark.parametrize("cfa", [X_TRANS, "L"])
def test_hot_pixels_of_any_pattern(make_raw: MakeRaw, cfa: str) -> None:
    rng = np.random.default_rng(1)
    hot = np.zeros((HEIGHT, WIDTH), bool)
    hot[rng.integers(0, HEIGHT, 20), rng.integers(0, WIDTH, 20)] = True
    darks = [make_raw(rng.normal(1000, 3, hot.shape) + 300 * hot, cfa=cfa) for _ in range(2)]
    assert np.array_equal(hot_pixels(darks), hot)


def test_a_monochrome_decay_is_a_series_of_one_channel(write_dng: WriteDng, tmp_path: Path) -> None:
    def take(name: str, light: float, cfa: str = "L") -> SeriesFrame:
        path = tmp_path / f"{name}.dng"
        black = (1000.0,) * len(cfa)
        pixels = 1003 + np.random.default_rng(0).poisson(light, (60, 80))
        path.write_bytes(write_dng(pixels, cfa, black, iso=100))
        return SeriesFrame(path, 1.0, 2.0)

    frames, region = [take("a", 800), take("b", 400)], (10, 10, 40, 40)
    dark = take("dark", 0)
    series = reduce_series(frames, region, [dark], name="paint")
    assert series.channels == ("L",)
    assert series.values[:, 0] == pytest.approx([400, 200], abs=4 * series.sigma.max())
    with pytest.raises(DataError, match="one sensor"):
        reduce_series([frames[0], take("c", 800, "RGGB")], region)
    with pytest.raises(DataError, match="of the same sensor"):
        reduce_series(frames, region, [take("d", 0, "RGGB")])


def test_black_by_row_and_column_counts_with_its_mean(write_dng: WriteDng) -> None:
    ramp = tuple(number for column in range(WIDTH) for number in (column - 90, 1))
    tags = [(BLACK_BY_COLUMN, "2i", WIDTH, ramp)]
    raw = read_raw(write_dng(Sensor("", "RGGB").mosaic(), black=FOUR, tags=tags))
    assert raw.black == pytest.approx(np.add(FOUR, (WIDTH - 1) / 2 - 90))


def test_without_a_black_level_that_of_the_masked_border_is_taken(write_dng: WriteDng) -> None:
    mosaic = Sensor("", "RGGB", area=(0, 12, HEIGHT, WIDTH)).mosaic()
    area = (ACTIVE_AREA, "I", 4, (0, 12, HEIGHT, WIDTH))
    masked = (MASKED_AREAS, "I", 4, (0, 0, HEIGHT, 12))
    assert read_raw(write_dng(mosaic, black=None, tags=[area])).black == (0,) * 4
    assert read_raw(write_dng(mosaic, black=None, tags=[area, masked])).black == (500,) * 4


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"cfa": "CYGM"}, "CYGM"),
        ({"cfa": "RGGW"}, "RGGW"),
        ({"black": tuple(range(1000, 1049))}, "got 14"),
        ({"tags": [(LAYOUT, "H", 1, 2)]}, "staggered"),
    ],
)
def test_other_sensors_are_refused(write_dng: WriteDng, settings: dict[str, Any], why: str) -> None:
    with pytest.raises(FrameError, match=why):
        read_raw(write_dng(Sensor("", "RGGB").mosaic(), **settings))
