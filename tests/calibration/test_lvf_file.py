"""The LVF file: what is written comes back exactly; strips and their slices."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError

from labrig.calibration import LVF_KIND, LvfFile
from labrig.calibration.lvf_file import BandColumns, WavelengthColumns
from labrig.foundation.errors import UsageError
from labrig.optics import Bands, Strip, WavelengthMap

STRIP = Strip(left=(0.1, 0.45), right=(0.9, 0.5), height=0.3, rising=False)
Numbers = st.floats(allow_nan=False, allow_infinity=False)
Positive = st.floats(min_value=0, max_value=1e6)


def columns(centre: list[float], value: float = 1.0) -> BandColumns:
    one = np.full(len(centre), value)
    return BandColumns.of(Bands(np.array(centre), 25 * one, 0 * one, one, 0.001 * one))


def lvf_file(**changed: Any) -> LvfFile:
    content: dict[str, Any] = {
        "position": (0.0, 0.5, 1.0),
        "bands": columns([400.0, 550.0, 700.0]),
        "sigma": columns([1.0, 1.0, 1.0], 0.1),
        "wavelengths": WavelengthColumns.of(
            WavelengthMap(np.array([550.0, 150.0]), (0.0, 1.0), np.diag([0.1, 0.2]))
        ),
        "before_camera": STRIP,
    }
    return LvfFile.model_validate(content | changed)


@st.composite
def strips(draw: st.DrawFn) -> Strip:
    height = draw(st.floats(0.05, 0.5))
    fraction = st.floats(height / 2, 1 - height / 2)
    left = draw(st.floats(0, 0.4))
    right = draw(st.floats(left + 0.2, 1))
    return Strip(
        left=(left, draw(fraction)),
        right=(right, draw(fraction)),
        height=height,
        rising=draw(st.booleans()),
    )


@given(
    sigma=st.tuples(*[Positive] * 3),
    remainder=st.lists(st.tuples(*[Numbers] * 3), max_size=4),
    strip=strips(),
    source=st.text(
        st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\x85\u2028\u2029")
    ),
)
def test_what_is_written_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    sigma: tuple[float, float, float],
    remainder: list[tuple[float, float, float]],
    strip: Strip,
    source: str,
) -> None:
    file = lvf_file(
        sigma=columns([400.0, 550.0, 700.0]).model_copy(update={"fwhm_nm": sigma}),
        remainder_nm=tuple(400.0 + 20 * k for k in range(len(remainder))),
        remainder=tuple(zip(*remainder, strict=True)),
        on_sample=strip,
        source=source,
    )
    folder = tmp_path_factory.mktemp("lvf")
    LVF_KIND.write(folder, file)
    assert LVF_KIND.read(folder / "lvf.yaml") == file


@given(strips(), st.integers(1, 40))
def test_slices_tile_the_strip_from_its_blue_end(strip: Strip, count: int) -> None:
    regions = list(strip.slices(count).values())
    left_to_right = regions if strip.rising else regions[::-1]
    ends = [(x, x + width) for x, _, width, _ in left_to_right]
    np.testing.assert_allclose(ends[0][0], strip.left[0])
    np.testing.assert_allclose(ends[-1][1], strip.right[0])
    np.testing.assert_allclose([a[1] for a in ends[:-1]], [b[0] for b in ends[1:]])
    middles = [(x + width / 2, y + height / 2) for x, y, width, height in left_to_right]
    slope = (strip.right[1] - strip.left[1]) / (strip.right[0] - strip.left[0])
    for x, y in middles:
        assert y == pytest.approx(strip.left[1] + slope * (x - strip.left[0]), abs=1e-9)


@pytest.mark.parametrize("rising", [True, False])
def test_positions_are_those_of_whole_pixels(rising: bool) -> None:
    strip = STRIP.model_copy(update={"rising": rising})
    fine = np.array(strip.positions(100_000, 1000))
    np.testing.assert_allclose(fine, (np.arange(31) + 0.5) / 31, atol=2e-5)
    coarse = np.array(strip.positions(96, 64))
    assert (np.diff(coarse) > 0).all()
    assert 0.001 < np.abs(coarse - fine).max() < 1 / (0.8 * 96)


def test_a_tilted_strip_says_by_how_much() -> None:
    assert STRIP.tilt_degrees(1000, 800) == pytest.approx(np.degrees(np.arctan2(40, 800)))


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: lvf_file(position=(0.0, 0.5)), "expected 2 numbers"),
        (lambda: lvf_file(position=(0.0, 0.5, 0.5)), "rising positions"),
        (lambda: lvf_file(bands=columns([400.0, 410.0, 405.0])), "rise or fall"),
        (lambda: lvf_file(remainder_nm=(400.0,)), "one row a position"),
        (lambda: Strip(left=(0.5, 0.5), right=(0.4, 0.5), height=0.1, rising=True), "to the right"),
        (lambda: Strip(left=(0.1, 0.1), right=(0.9, 0.5), height=0.3, rising=True), "leaves it"),
    ],
)
def test_what_is_no_filter_is_refused(build: Callable[[], object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        build()


def test_a_malformed_file_is_one_line(tmp_path: Path) -> None:
    LVF_KIND.write(tmp_path, lvf_file())
    path = tmp_path / "lvf.yaml"
    path.write_text(path.read_text().replace("centre_nm", "center_nm", 1))
    with pytest.raises(UsageError, match="did you mean 'centre_nm'") as caught:
        LVF_KIND.read(path)
    assert "\n" not in str(caught.value)
