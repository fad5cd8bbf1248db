"""Live view of the room: quick, small and developed for display."""

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

from .sensor import read_noise_electrons

#: Longest side of a live picture; about that of a 5D Mark II's.
LIVE_PIXELS = 1056
#: Exposure, sensitivity and aperture of a live picture: the camera opens the lens and turns its
#: gain up to see anything.
LIVE_EXPOSURE_S = 1 / 30
LIVE_ISO = 1600
LIVE_F_NUMBER = 4.0
#: Scatter of the live picture's pixels: lines are skipped, so it is noisier than a photograph.
NOISE_FACTOR = 3.0
#: Electrons that are white on the display, at `LIVE_ISO`.
WHITE_ELECTRONS = 3_000.0
#: Where the camera's own metering puts the bright part of the picture at most.
METERED = 0.5
METERED_PERCENTILE = 90
#: Cloth and paint have a grain, without which there would be nothing to focus on.
GRAIN = 0.08
GRAIN_SEED = 20


def live_stride(height: int, width: int) -> int:
    """Return the step in Bayer cells between two pixels of a live picture."""
    return max(1, round(max(height, width) / 2 / LIVE_PIXELS + 0.499))


def developed(electrons: FloatArray, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return a live picture as a camera shows it.

    Parameters
    ----------
    electrons : ndarray, shape (height, width, 3)
        Expected photo-electrons of R, G, B.
    rng
        Random generator of this picture alone.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Picture for a display.
    """
    grain = np.random.default_rng(GRAIN_SEED).standard_normal(electrons.shape[:2])
    brightest = float(np.percentile(electrons, METERED_PERCENTILE))
    # A shorter exposure where there is light enough; a longer one would make the picture jerky.
    shortened = min(1.0, METERED * WHITE_ELECTRONS / max(brightest, 1e-9))
    light = shortened * electrons * (1 + GRAIN * grain)[:, :, None]
    scatter = NOISE_FACTOR * np.sqrt(np.maximum(light, 0.0) + read_noise_electrons(LIVE_ISO) ** 2)
    light += scatter * rng.standard_normal(light.shape, dtype=np.float32)
    # The camera's own white balance, roughly: green counts most.
    balanced = light * np.array([1.9, 1.0, 1.6]) / WHITE_ELECTRONS
    picture: NDArray[np.uint8] = np.clip(
        255.0 * np.clip(balanced, 0.0, 1.0) ** (1 / 2.2) + 0.5, 0, 255
    ).astype(np.uint8)
    return picture
