"""Sheets of rendered frames show them as they are."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from labrig.foundation.errors import UsageError
from labrig.report import draw_frames

Bytes = NDArray[np.uint8]

pytestmark = pytest.mark.drawn


def contains(sheet: Bytes, frame: Bytes) -> bool:
    """Whether all pixels of a frame stand somewhere on a sheet, in their places."""
    height, width = frame.shape[:2]
    corner = (sheet[: -height + 1, : -width + 1] == frame[0, 0]).all(axis=-1)
    return any(
        np.array_equal(sheet[y : y + height, x : x + width], frame) for y, x in np.argwhere(corner)
    )


def test_every_frame_is_on_the_sheet_pixel_by_pixel(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    frames = [rng.integers(0, 256, (90, 230, 3), dtype=np.uint8) for _ in range(5)]
    draw_frames(frames, [f"{t} s" for t in range(5)], tmp_path / "a.png", "title", "caption")
    with Image.open(tmp_path / "a.png") as image:
        sheet = np.asarray(image.convert("RGB"))
    assert all(contains(sheet, frame) for frame in frames)


def test_small_frames_are_magnified_and_large_ones_averaged(tmp_path: Path) -> None:
    small = np.random.default_rng(2).integers(0, 256, (20, 40, 3), dtype=np.uint8)
    draw_frames([small], ["0 s"], tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        sheet = np.asarray(image.convert("RGB"))
    assert contains(sheet, small.repeat(5, axis=0).repeat(5, axis=1))
    large = np.full((1080, 1920, 3), 77, np.uint8)
    draw_frames([large] * 20, ["0 s"] * 20, tmp_path / "b.png")
    with Image.open(tmp_path / "b.png") as image:
        assert max(image.size) <= 2000
        assert contains(np.asarray(image.convert("RGB")), np.full((270, 480, 3), 77, np.uint8))


def test_frames_that_are_no_sheet_are_refused(tmp_path: Path) -> None:
    frame = np.zeros((4, 4, 3), np.uint8)
    for frames, labels in (([], []), ([frame, frame[:2]], ["a", "b"]), ([frame], [])):
        with pytest.raises(UsageError, match=r"^[^\n]*expected [^\n]+$"):
            draw_frames(frames, labels, tmp_path / "a.png")
    with pytest.raises(UsageError, match="ends in"):
        draw_frames([frame], ["a"], tmp_path / "a.jpg")
