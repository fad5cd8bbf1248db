"""Which exposure pictures of a rendering have."""

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.optics import illuminant
from labrig.reproduce import SpectralFrame, shown_frames, white_under

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


def test_a_white_surface_is_white_in_the_light_that_it_is_adapted_to() -> None:
    """Under a halogen lamp it is orange without; eyes in the dark are adapted to no lamp."""
    lamp = illuminant("A")
    image = np.broadcast_to(lamp.in_bands(EDGES_NM), (8, 8, 24)).astype(np.float32)
    white = white_under(lamp, EDGES_NM)
    lit = SpectralFrame(image, EDGES_NM, "", {})
    for exposure in ("each", "common"):
        ((picture, display),) = shown_frames([lit], exposure, adapted_white=white)
        assert picture.min() >= 254
        assert display.adapted_white == white
    ((picture, _),) = shown_frames([lit])
    assert (picture[..., 0] > picture[..., 2] + 60).all()
    faint = SpectralFrame(np.float32(1e-9) * image, EDGES_NM, "", {})
    ((night, _),), ((other, _),) = (
        shown_frames([faint], night=True, adapted_white=each) for each in (None, white)
    )
    np.testing.assert_array_equal(night, other)
