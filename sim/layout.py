"""Layout of the picture: samples, cards, and the linear variable filter on them and before them.

As of a real filter, its pass band is no Gaussian: flatter on top, steeper at its sides, with a
shoulder towards long wavelengths; its wavelength is not quite linear along the strip.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d

from labrig.foundation.arrays import FloatArray, IntArray
from labrig.foundation.region import Region, region_pixels

from .arrangement import Arrangement, Card, LvfPlace
from .bench_settings import LvfSettings, StripSettings
from .cards import surfaces
from .lamp import WAVELENGTH_NM
from .sensor import BAYER_RGGB
from .simulation import Simulation

#: The strip is made of so many evenly wide pieces: less than 1 nm each, whatever the sensor.
PIECES = 400

#: Order of the pass band's exponential; 2 would be a Gaussian.
ORDER = 2.4
#: Height of the shoulder, its distance and width in widths of the pass band.
SHOULDER, SHOULDER_AWAY, SHOULDER_WIDE = 0.03, 0.8, 1.2
#: Widths at the ends of the strip, of that in its middle.
WIDTHS = (0.92, 1.08)
#: Transmission of the pass band at blue end, in the middle and at the red end.
PEAKS = (0.42, 0.58, 0.52)
#: Fraction of the bend that has one turn more.
WIGGLE = 0.15


class Lvf:
    """The filter itself, and its two places.

    Parameters
    ----------
    settings
        Settings of the filter.
    """

    def __init__(self, settings: LvfSettings) -> None:
        self._settings = settings

    def centre_nm(self, u: FloatArray) -> FloatArray:
        """Return the middle of the pass band from the blue end, u = 0, to the red end, u = 1."""
        blue, red = self._settings.centre
        bend = np.sin(np.pi * u) + WIGGLE * np.sin(2 * np.pi * u)
        centre: FloatArray = blue + (red - blue) * u + self._settings.bend_nm * bend
        return centre

    def transmission(self, u: FloatArray, wavelength_nm: FloatArray = WAVELENGTH_NM) -> FloatArray:
        """Return T(λ) at some places (p,) and wavelengths (n,), shape (p, n)."""
        fwhm_nm = self._settings.fwhm_nm * np.interp(u, [0.0, 1.0], WIDTHS)[:, None]
        x = 2 * (wavelength_nm - self.centre_nm(u)[:, None]) / fwhm_nm
        # The two together are 1 high and, at half of that, `fwhm_nm` wide to within 1 %.
        main = np.exp(-math.log(2) * np.abs(x) ** ORDER)
        shoulder = np.exp(-math.log(2) * ((x - 2 * SHOULDER_AWAY) / SHOULDER_WIDE) ** 2)
        peak = np.interp(u, [0.0, 0.5, 1.0], PEAKS)[:, None]
        band = peak * (main + SHOULDER * shoulder) / (1 + SHOULDER)
        leakage = self._settings.leakage
        passed: FloatArray = leakage + (1 - leakage) * band
        return passed

    def seen(self, strip: StripSettings, turned: bool) -> FloatArray:
        """Return T(λ) of all pieces of a strip from left to right, the holder's before them.

        Returns
        -------
        ndarray, shape (1 + PIECES, wavelengths)
            Transmittance on `WAVELENGTH_NM`.
        """
        rising, falling = self._rising, self._rising[::-1]
        pieces = rising if strip.rising != turned else falling
        return np.concatenate([np.zeros((1, pieces.shape[1])), pieces])

    def below(self, strip: StripSettings, turned: bool) -> FloatArray:
        """Return the light on the sample below all pieces of a strip, shaped as by `seen`."""
        passed = self.seen(strip, turned)
        if self._settings.spread:
            width = self._settings.spread * PIECES
            passed[1:] = gaussian_filter1d(passed[1:], width, axis=0, mode="nearest")
        return passed

    @cached_property
    def _rising(self) -> FloatArray:
        return self.transmission((np.arange(PIECES) + 0.5) / PIECES)


def pieces(strip: StripSettings, width: int, height: int) -> IntArray:
    """Return the piece of a strip before each pixel, as in `Lvf.seen`, shape (height, width).

    Raises
    ------
    UsageError
        The strip leaves the frame.
    """
    region_pixels(strip.region, width, height)
    x, y, wide, high = in_pixels(strip.region, width, height)
    along = math.radians(strip.tilt)
    from_x = np.arange(width) + 0.5 - (x + wide / 2)
    from_y = (np.arange(height) + 0.5 - (y + high / 2))[:, None]
    u = (from_x * math.cos(along) + from_y * math.sin(along)) / wide + 0.5
    v = (from_y * math.cos(along) - from_x * math.sin(along)) / high + 0.5
    inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    piece: IntArray = np.where(inside, 1 + np.floor(u * PIECES).astype(np.intp), 0)
    return piece


def in_pixels(region: Region, width: int, height: int) -> tuple[float, float, float, float]:
    """Return a region in pixels, not rounded."""
    x, y, wide, high = region
    if max(region) > 1:
        return region
    return x * width, y * height, wide * width, high * height


@dataclass(frozen=True)
class Places:
    """All parts of a picture that can look different, arrays of shape (places,).

    Attributes
    ----------
    cell
        Index of the cell at each place, see `Layout`.
    surface
        Index of the card's surface on it, see `cards`; 0 for none.
    piece
        Index of the piece of the LVF's strip before it, see `lvf`.
    painted : ndarray, shape (height, width)
        For every pixel 4 times its place, plus its index among the four pixels of a Bayer cell.
    """

    cell: IntArray
    surface: IntArray
    piece: IntArray
    painted: IntArray


class Layout:
    """Cells of the picture: the cloth, and each part of a sample below its own piece of the strip.

    Attributes
    ----------
    patch, piece : ndarray, shape (cells,)
        Sample of every cell, from 1 on, and the piece of the strip on it; cell 0 is the cloth.
        Without an LVF a sample is one cell.
    pixels : ndarray, shape (cells,)
        Number of pixels of a cell.

    Raises
    ------
    UsageError
        A patch or a strip is outside the frame.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._size = simulation.sensor.width, simulation.sensor.height
        width, height = self._size
        patch = np.zeros((height, width), dtype=np.intp)
        for number, placed in enumerate(simulation.patches, start=1):
            x, y, wide, high = region_pixels(placed.region, width, height)
            patch[y : y + high, x : x + wide] = number  # a later patch lies on an earlier one
        lvf = simulation.lvf
        self._strips = {} if lvf is None else {
            "before camera": pieces(lvf.before_camera, width, height),
            "on sample": pieces(lvf.on_sample, width, height),
        }  # fmt: skip
        numbers = patch * (PIECES + 1)
        if lvf is not None:
            numbers += np.where(patch > 0, self._strips["on sample"], 0)
        # The cloth and every patch have a cell, even one that others hide.
        every = np.arange(len(simulation.patches) + 1) * (PIECES + 1)
        pixels = np.bincount(numbers.ravel(), minlength=int(every[-1]) + 1)
        cells = np.union1d(np.flatnonzero(pixels), every)
        self._cells = np.searchsorted(cells, numbers)
        self.patch, self.piece = np.divmod(cells, PIECES + 1)
        self.pixels = pixels[cells]
        self._places_by_arrangement: dict[tuple[Card, int, LvfPlace], Places] = {}

    def places(self, arrangement: Arrangement) -> Places:
        """Return all places that look different in an arrangement."""
        through = self.looked_through(arrangement)
        key = arrangement.card, arrangement.chart_patch, through
        if key not in self._places_by_arrangement:
            self._places_by_arrangement[key] = self._places(*key)
        return self._places_by_arrangement[key]

    def looked_through(self, arrangement: Arrangement) -> LvfPlace:
        """Return the LVF's place if the camera looks through it, else `away`.

        Without a door the sample does not leave an LVF that lies on it.
        """
        if arrangement.lvf == "on sample" and self._simulation.door is not None:
            return "away"
        return arrangement.lvf

    def _places(self, card: Card, chart_patch: int, through: LvfPlace) -> Places:
        width, height = self._size
        chart, black_trap = self._simulation.chart, self._simulation.black_trap
        surface = surfaces(card, chart, width, height, black_trap, chart_patch)
        piece = self._strips.get(through, np.zeros_like(surface))
        numbers = (self._cells * (surface.max() + 1) + surface) * (PIECES + 1) + piece
        distinct = np.flatnonzero(np.bincount(numbers.ravel()))
        place = np.searchsorted(distinct, numbers)
        remainder, pieces_found = np.divmod(distinct, PIECES + 1)
        cells_found, surfaces_found = np.divmod(remainder, surface.max() + 1)
        bayer = np.tile(np.arange(len(BAYER_RGGB)).reshape(2, 2), (height // 2, width // 2))
        painted = place * len(BAYER_RGGB) + bayer
        return Places(cells_found, surfaces_found, pieces_found, painted)
