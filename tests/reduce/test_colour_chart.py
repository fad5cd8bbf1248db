"""A ColorChecker in a frame, however it lies."""

from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.errors import DataError
from labrig.reduce import find_colour_chart, measure, read_raw
from labrig.sim.dng import Shot, encode_dng

#: Middles of columns and rows in pixels.
X, Y = (704, 816, 926, 1034, 1146, 1256), (624, 720, 820, 930)


@pytest.fixture
def photograph(real_data: Path) -> Path:
    return real_data / "canon_550d/canon_550d_kissx4_colorchecker.dng"


def test_the_patches_of_a_real_chart_are_found_where_they_are(photograph: Path) -> None:
    raw = read_raw(photograph)
    height, width = raw.mosaic.shape
    found = find_colour_chart(photograph)
    middles = [((x + w / 2) * width, (y + h / 2) * height) for x, y, w, h in found]
    expected = [(x, y) for y in Y for x in X]
    # A quarter of the distance of neighbours.
    np.testing.assert_allclose(middles, expected, atol=25)


@pytest.mark.parametrize("turned", [False, True])
def test_an_upside_down_chart_is_read_from_its_brown_patch(
    photograph: Path, tmp_path: Path, turned: bool
) -> None:
    raw = read_raw(photograph)
    # Black and white of a file that the simulated camera writes; turned, RGGB stays RGGB.
    light = (raw.mosaic.astype(np.float64) - raw.black[0]) / (raw.white - raw.black[0])
    light = light[1:-1, 1:-1][::-1, ::-1] if turned else light
    path = tmp_path / "chart.dng"
    mosaic = np.clip(1024 + light * 14000, 0, 15300).astype(np.uint16)
    path.write_bytes(encode_dng(mosaic, Shot(0.0, 1 / 60, 100, 4.0)))
    frame = read_raw(path)
    assert frame.cfa == "RGGB"
    green = [measure(frame, region).channels["G"].mean for region in find_colour_chart(path)]
    assert np.argmax(green) == 18, "white"
    assert (np.diff(green[18:]) < 0).all(), "greys, lightest first"


def test_no_chart_is_one_clear_line(tmp_path: Path) -> None:
    path = tmp_path / "grey.dng"
    path.write_bytes(encode_dng(np.full((64, 96), 6000, np.uint16), Shot(0.0, 1 / 60, 100, 4.0)))
    with pytest.raises(DataError, match="expected a ColorChecker, found none") as caught:
        find_colour_chart(path)
    assert "\n" not in str(caught.value)
