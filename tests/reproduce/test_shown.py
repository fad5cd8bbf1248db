"""Which exposure pictures of a rendering have."""

import numpy as np
import pytest

from labrig.errors import UsageError
from labrig.reproduce import SpectralFrame, shown_frames

EDGES_NM = np.linspace(300, 780, 25)


def frame(radiance: float) -> SpectralFrame:
    """A picture that glows evenly in the blue, with a small lamp in a corner."""
    image = np.zeros((60, 60, 24), np.float32)
    image[..., 7:10] = radiance
    image[0, :4] = 1e3 * radiance
    return SpectralFrame(image, EDGES_NM, "", {})


FRAMES = [frame(1e-2), frame(1e-5), frame(0.0)]


@pytest.mark.parametrize("night", [False, True])
def test_each_is_bright_whatever_shines_beside_it_and_darkness_is_black(night: bool) -> None:
    lit, dim, dark = (picture for picture, _ in shown_frames(FRAMES, night=night))
    for picture in (lit, dim):
        assert 0.3 < np.median(picture.max(axis=2)) / 255 <= 1
    assert np.median(dark) < 30


def test_one_exposure_for_all_is_that_of_the_brightest() -> None:
    (lit, first), (dim, second), _ = shown_frames(FRAMES, "common")
    assert first == second
    assert np.median(lit.max(axis=2)) > 10 * np.median(dim.max(axis=2))


def test_a_given_white_is_taken_and_what_is_none_is_refused() -> None:
    for _, display in shown_frames(FRAMES, "2.5"):
        assert display.white_luminance == 2.5
    for wrong in ("bright", "0", "nan"):
        with pytest.raises(UsageError):
            shown_frames(FRAMES, wrong)
