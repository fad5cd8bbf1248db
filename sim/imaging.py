"""What keeps a photograph from being the scene: grain of the surfaces, defocus, veiling glare."""

import zlib
from collections.abc import Iterator

import cv2
import numpy as np

from labrig.foundation.arrays import Float32Array

from .arrangement import Arrangement
from .bench_settings import ImagingSettings

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
