"""Exposures of one scene combined, from frames whose light is known."""

from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.errors import DataError
from labrig.reduce import read_raw
from labrig.reduce.hdr import hdr_frame
from labrig.sim.dng import Shot, encode_dng
from labrig.sim.sensor import BLACK_DN, WHITE_DN

WIDTH, HEIGHT = 96, 64
EXPOSURES_S = (0.5, 4.0)


@pytest.fixture
def light_dn_per_s() -> np.ndarray:
    """Columns from dark to three times the range in the longest exposure."""
    full = (WHITE_DN - BLACK_DN) / EXPOSURES_S[1]
    return np.tile(np.linspace(0.0, 3.0 * full, WIDTH), (HEIGHT, 1))


def frames(folder: Path, light_dn_per_s: np.ndarray) -> list[tuple[Path, float]]:
    made = []
    for exposure_s in EXPOSURES_S:
        mosaic = np.minimum(BLACK_DN + light_dn_per_s * exposure_s, WHITE_DN).round()
        path = folder / f"{exposure_s}.dng"
        path.write_bytes(
            encode_dng(mosaic.astype(np.uint16), Shot(0.0, exposure_s, 400, 4.0, None))
        )
        made.append((path, exposure_s))
    return made


def test_a_pixel_counts_where_it_does_not_clip(tmp_path: Path, light_dn_per_s: np.ndarray) -> None:
    pairs = [(read_raw(path), s) for path, s in frames(tmp_path, light_dn_per_s)]
    hdr = hdr_frame(pairs)
    # Rounding to whole DN in the exposure that counts is all that is left.
    np.testing.assert_allclose(hdr.rate, light_dn_per_s, atol=0.5 / EXPOSURES_S[0])
    counts_long = light_dn_per_s * EXPOSURES_S[1] < 0.9 * (WHITE_DN - BLACK_DN)
    np.testing.assert_allclose(
        hdr.rate[counts_long], light_dn_per_s[counts_long], atol=1.0 / sum(EXPOSURES_S)
    )


def test_hot_pixels_and_what_clips_throughout_have_no_rate(
    tmp_path: Path, light_dn_per_s: np.ndarray
) -> None:
    light_dn_per_s[0, 0] = 10 * (WHITE_DN - BLACK_DN) / EXPOSURES_S[0]
    hot = np.zeros((HEIGHT, WIDTH), np.bool_)
    hot[3, 5] = True
    pairs = [(read_raw(path), s) for path, s in frames(tmp_path, light_dn_per_s)]
    hdr = hdr_frame(pairs, hot)
    assert np.argwhere(np.isnan(hdr.rate)).tolist() == [[0, 0], [3, 5]]
    with pytest.raises(DataError, match="got none"):
        hdr_frame([])
