"""From the scene to a picture: grain of the surfaces, defocus, veiling glare; the live view."""

import zlib
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, FloatArray

from .arrangement import Arrangement
from .bench_settings import ImagingSettings
from .sensor import read_noise_electrons

#: Grain of surfaces is never darker than this part of them.
DARKEST = 0.05
#: A blur reaches so far, in its standard deviations.
REACH = 4.0


class Imaging:
    """Path of the light from the surfaces to the sensor, as far as it is not ideal.

    Parameters
    ----------
    settings
        Settings of grain, defocus and glare.
    seed
        Seed of the grain.
    """

    def __init__(self, settings: ImagingSettings, seed: int) -> None:
        self._settings = settings
        self._seed = seed
        self._grains: dict[tuple[int, ...], Float32Array] = {}

    def textured(self, light: Float32Array, arrangement: Arrangement) -> Float32Array:
        """Return the light of all pixels with the grain of what lies there.

        Parameters
        ----------
        light : ndarray, shape (height, width)
            Expected electrons of a mosaic with even surfaces.
        arrangement
            Arrangement of the bench: another card, or a sample that was put in anew, shows another
            grain.
        """
        if not self._settings.texture:
            return light
        stream = (self._seed, zlib.crc32(arrangement.card.encode()), arrangement.placing)
        if stream not in self._grains:
            self._grains[stream] = self._grain(light.shape, np.random.default_rng(stream))
        textured: Float32Array = light * self._grains[stream]
        return textured

    def imaged(self, light: Float32Array) -> Float32Array:
        """Return a mosaic, shape (height, width), blurred by the lens and veiled by its glare."""
        defocus, glare = self._settings.defocus_px / 2, self._settings.glare
        if not defocus and not glare:
            return light
        imaged = light.copy()
        for colour in _colours(imaged):
            if defocus:
                colour[...] = _blurred(colour, defocus)
            if glare:
                colour[...] = (1 - glare) * colour + glare * colour.mean(dtype=np.float64)
        return imaged

    def _grain(self, shape: tuple[int, ...], rng: np.random.Generator) -> Float32Array:
        noise = rng.standard_normal(shape, dtype=np.float32)
        if self._settings.texture_px:
            noise = _blurred(noise, self._settings.texture_px)
        noise *= self._settings.texture / noise.std()
        grain: Float32Array = np.maximum(1 + noise, np.float32(DARKEST))
        return grain


def _colours(mosaic: Float32Array) -> Iterator[Float32Array]:
    """Yield views of the four places of a Bayer cell."""
    for row in (0, 1):
        for column in (0, 1):
            yield mosaic[row::2, column::2]


def _blurred(picture: Float32Array, sigma_px: float) -> Float32Array:
    size = 2 * round(REACH * sigma_px) + 1
    blurred = cv2.GaussianBlur(picture, (size, size), sigma_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float32)


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
