"""Patterns of files that are no DNG, which only LibRaw tells: what it says is made here."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from labrig.foundation.errors import FrameError
from labrig.reduce.raw import sensor_pattern

X_TRANS = "GGRGGBGGBGGRBRGRBGGGBGGRGGRGGBRBGBRG"


def _opened(pattern: Any, names: bytes = b"RGBG", margins: tuple[int, int] = (0, 0)) -> Any:
    """What rawpy shows of an open file."""
    return SimpleNamespace(
        raw_pattern=pattern,
        color_desc=names,
        black_level_per_channel=[10, 11, 12, 13],
        sizes=SimpleNamespace(top_margin=margins[0], left_margin=margins[1]),
    )


def test_patterns_of_files_that_are_no_dng() -> None:
    numbers = np.array(["RGB".index(letter) for letter in X_TRANS]).reshape(6, 6)
    bayer, mono = np.array([[1, 0], [2, 3]]), np.array([[6]])
    assert sensor_pattern(_opened(bayer), None) == ("GRBG", (11, 10, 12, 13))
    assert sensor_pattern(_opened(None), None) == ("L", (10,))
    assert sensor_pattern(_opened(mono, b"GMCY"), None) == ("L", (10,))
    x_trans = sensor_pattern(_opened(numbers, margins=(6, 12)), None)
    assert x_trans == (X_TRANS, tuple(10 + numbers.ravel()))
    with pytest.raises(FrameError, match=r"margins \(6, 1\)"):
        sensor_pattern(_opened(numbers, margins=(6, 1)), None)
    with pytest.raises(FrameError, match="GMCY"):
        sensor_pattern(_opened(bayer, b"GMCY"), None)
