"""A frame in linear numbers: signal above black and dark, its variance, and its saturated pixels.

Pixels are computed on demand, those of a region without the rest of the frame.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from labrig.foundation.region import Region, region_pixels
from labrig.optics import Flat, rho_squared
from labrig.reduce.channels import PixelMask
from labrig.reduce.photon_transfer import NoiseModel
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import RawFrame
from labrig.reduce.rounding import ROUNDING_VARIANCE
from labrig.reduce.saturation import is_clipped

Pixel = TypeVar("Pixel", np.uint16, np.bool_)

#: x, y, width, height in pixels.
Area = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class RegionSums:
    """Sums over the pixels of each channel in a region, row by row of the sensor.

    Attributes
    ----------
    value_dn
        Sum of the values in DN without hot pixels, shape (rows, C).
    variance_dn2
        Sum of the variances in DN² without hot pixels, shape (rows, C).
    pixels
        Number of pixels without hot ones, shape (rows, C).
    saturated
        Number of those that are saturated, shape (rows, C).
    """

    value_dn: Floats
    variance_dn2: Floats
    pixels: Floats
    saturated: Floats

    @property
    def mean_dn(self) -> Floats:
        """Mean over the pixels in DN, shape (C,); NaN without any pixel."""
        return self._over_pixels(self.value_dn.sum(axis=0))

    @property
    def sigma_dn(self) -> Floats:
        """Standard uncertainty of the mean by pixel noise in DN, shape (C,); NaN if unknown."""
        return self._over_pixels(np.sqrt(self.variance_dn2.sum(axis=0)))

    @property
    def is_clipped(self) -> npt.NDArray[np.bool_]:
        """Whether saturated pixels make the mean too small, shape (C,)."""
        return is_clipped(self.saturated.sum(axis=0), self.pixels.sum(axis=0))

    def strip_means_dn(self, strips: int) -> Floats:
        """Return the means over bands of rows, as equal as possible, in DN, shape (strips, C)."""
        starts = np.arange(strips) * len(self.pixels) // strips
        pixels = np.add.reduceat(self.pixels, starts)
        return np.asarray(np.add.reduceat(self.value_dn, starts) / np.maximum(pixels, 1))

    def _over_pixels(self, total: Floats) -> Floats:
        pixels = self.pixels.sum(axis=0)
        return np.where(pixels > 0, total / np.maximum(pixels, 1), np.nan)


@dataclass(frozen=True, eq=False)
class LinearFrame:
    """A RAW frame with the calibration of its camera.

    Parameters
    ----------
    raw
        The RAW frame.
    dark_dn
        Dark level of each channel in DN above black, shape (C,), as a `DarkModel` gives it for the
        exposure time; None subtracts nothing.
    flat
        Vignetting of the lens, which is divided out; None leaves it.
    noise
        Noise of a pixel of each of the C channels; None if unknown.
    hot
        Hot pixels that no sum counts, shape (height, width).
    """

    raw: RawFrame
    dark_dn: Floats | None = None
    flat: Flat | None = None
    noise: Sequence[NoiseModel] | None = None
    hot: PixelMask | None = None

    def value_dn(self, area: Area | None = None) -> Floats:
        """Return the signal in DN, vignetting divided out, shape (rows, columns)."""
        pixels = self._window(self.raw.mosaic, area)
        light = np.empty(pixels.shape)
        dark = np.zeros(len(self.raw.channels)) if self.dark_dn is None else self.dark_dn
        for plane in self._planes(area):
            level = self.raw.levels_dn(pixels[plane.slices])
            light[plane.slices] = level - (plane.black + dark[plane.channel])
            if self.flat is not None:
                light[plane.slices] /= self._falloff(self.flat, plane, area)
        return light

    def variance_dn2(self, area: Area | None = None) -> Floats:
        """Return the variance of `value_dn` by photon and read noise in DN²; NaN if unknown."""
        level = self._window(self.raw.mosaic, area).astype(np.float64)
        variance = np.full_like(level, np.nan)
        if self.noise is None:
            return variance
        for plane in self._planes(area):
            pixel_variance = self.noise[plane.channel].variance_dn2(
                level[plane.slices] - plane.black
            )
            variance[plane.slices] = np.maximum(pixel_variance, ROUNDING_VARIANCE)
            if self.flat is not None:
                variance[plane.slices] /= self._falloff(self.flat, plane, area) ** 2
        return variance

    def is_saturated(self, area: Area | None = None) -> PixelMask:
        """Return whether each pixel is at white or above, shape (rows, columns)."""
        return np.asarray(self._window(self.raw.mosaic, area) >= self.raw.white)

    def sums(self, area: Area) -> RegionSums:
        """Return the sums of each channel in an area of the frame."""
        value, variance = self.value_dn(area), self.variance_dn2(area)
        saturated = self.is_saturated(area)
        kept = np.ones_like(saturated) if self.hot is None else ~self._window(self.hot, area)
        value_sum, variance_sum, pixels, saturated_pixels = np.zeros(
            (4, len(value), len(self.raw.channels))
        )
        for plane in self._planes(area):
            rows, counted = (plane.slices[0], plane.channel), kept[plane.slices]
            value_sum[rows] += value[plane.slices].sum(axis=1, where=counted)
            variance_sum[rows] += variance[plane.slices].sum(axis=1, where=counted)
            pixels[rows] += counted.sum(axis=1)
            saturated_pixels[rows] += (saturated[plane.slices] & counted).sum(axis=1)
        return RegionSums(value_sum, variance_sum, pixels, saturated_pixels)

    def region_sums(self, region: Region) -> RegionSums:
        """Return the sums of each channel in a region, in fractions of the frame."""
        return self.sums(region_pixels(region, self.raw.width, self.raw.height))

    def _window(self, pixels: npt.NDArray[Pixel], area: Area | None) -> npt.NDArray[Pixel]:
        x, y, width, height = area or (0, 0, self.raw.width, self.raw.height)
        return pixels[y : y + height, x : x + width]

    def _planes(self, area: Area | None) -> Iterator["_Plane"]:
        """Iterate over the positions of the colour filter in an area."""
        raw, (x, y, *_) = self.raw, area or (0, 0)
        side = raw.cfa_side
        for row, column in np.ndindex(side, side):
            position = side * ((y + row) % side) + (x + column) % side
            slices = slice(row, None, side), slice(column, None, side)
            yield _Plane(raw.channels.index(raw.cfa[position]), raw.black[position], slices)

    def _falloff(self, flat: Flat, plane: "_Plane", area: Area | None) -> Floats:
        """Return the transmission of the lens relative to its axis at the pixels of a plane."""
        raw, (x, y, width, height) = self.raw, area or (0, 0, self.raw.width, self.raw.height)
        rows, columns = plane.slices
        across, down = np.meshgrid(
            np.arange(x, x + width)[columns] + 0.5, np.arange(y, y + height)[rows] + 0.5
        )
        return flat.at(rho_squared(across, down, raw.width, raw.height))[..., plane.channel]


class _Plane(NamedTuple):
    """Pixels of one position of the colour filter.

    Attributes
    ----------
    channel
        Number of their channel.
    black
        Their black level in DN.
    slices
        Their rows and columns in the area.
    """

    channel: int
    black: float
    slices: tuple[slice, slice]


def cell_means_dn(raw: RawFrame) -> npt.NDArray[np.float32]:
    """Return the means of each channel in the cells of the colour filter, in DN above black.

    The picture is binned and not demosaiced, so that no value is interpolated. Without a colour
    filter, cells have 2 × 2 pixels.

    Parameters
    ----------
    raw
        The RAW frame.

    Returns
    -------
    ndarray of float32
        Means in DN, shape (rows, columns, C).

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import cell_means_dn
    >>> cell_means_dn(labrig.read_raw("frame.dng")).shape
    (32, 48, 3)
    """
    side = max(raw.cfa_side, 2)
    rows, columns = raw.height // side, raw.width // side
    picture = np.zeros((rows, columns, len(raw.channels)), np.float32)
    for y, x in np.ndindex(side, side):
        position = raw.cfa_side * (y % raw.cfa_side) + x % raw.cfa_side
        letter, black = raw.cfa[position], np.float32(raw.black[position])
        fraction = np.float32(len(raw.cfa) / side**2 / raw.cfa.count(letter))
        plane = raw.mosaic[y : side * rows : side, x : side * columns : side]
        level = raw.levels_dn(plane).astype(np.float32)
        picture[..., raw.channels.index(letter)] += (level - black) * fraction
    return picture


def saturated_cells(raw: RawFrame) -> PixelMask:
    """Mark the cells of the colour filter in which some pixel is saturated.

    Parameters
    ----------
    raw
        The RAW frame.

    Returns
    -------
    ndarray of bool
        True where a cell is saturated, shape (rows, columns) of the picture by `binned`.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.reduce import saturated_cells
    >>> saturated = saturated_cells(labrig.read_raw("frame.dng"))
    >>> saturated.shape, bool(saturated.any())
    ((32, 48), False)
    """
    side = max(raw.cfa_side, 2)
    rows, columns = raw.height // side, raw.width // side
    cells = raw.mosaic[: side * rows, : side * columns].reshape(rows, side, columns, side)
    return np.asarray((cells >= raw.white).any(axis=(1, 3)))
