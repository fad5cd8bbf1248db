"""Constraints of a design: the wanted radiance at places and times."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.design.bands import RGB_TO_Y, DesignBands
from labrig.design.light import STRONGEST
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError

#: Luminance, as a part of the brightest key's, below which a key is black.
FLOOR = 1e-6
#: Radiance below which a key is black.
BLACK = 1e-15
#: Relative difference below which two keys at one place and time want the same.
SAME = 1e-9
#: Largest number of keys: above it nobody has set them by hand, and the search takes minutes.
MAX_KEYS = 5000


@dataclass(frozen=True, eq=False)
class Keys:
    """Wanted radiances, reflected light included.

    Attributes
    ----------
    place
        Number of each key's place in the light programme, shape (m,).
    time_s
        Time of each key in s, on the clock of the light programme, shape (m,).
    radiance
        Radiance that leaves the place, in the unit of the irradiance per sr: in the bands, shape
        (m, bands), or as linear sRGB of it, shape (m, 3).
    """

    place: NDArray[np.intp]
    time_s: FloatArray
    radiance: FloatArray

    @classmethod
    def checked(cls, place: ArrayLike, time_s: ArrayLike, radiance: ArrayLike) -> Self:
        """Return keys that were checked, one for each place and time; below 1e-15 they are black.

        Parameters
        ----------
        place
            Numbers of places, shape (m,) or one for all.
        time_s
            Times in s, shape (m,).
        radiance
            Radiances, shape (m, bands) or (m, 3).

        Raises
        ------
        UsageError
            There is no key, or too many; shapes disagree; a value is not finite; or two keys want
            different radiances of one place at one time.
        """
        time = np.asarray(time_s, dtype=np.float64)
        wanted = np.asarray(radiance, dtype=np.float64)
        if time.ndim != 1 or not len(time):
            raise UsageError("expected at least one key, got none; say when it should glow how")
        if len(time) > MAX_KEYS:
            raise UsageError(f"expected at most {MAX_KEYS} keys, got {len(time)}; leave some out")
        if wanted.ndim != 2 or len(wanted) != len(time):
            raise UsageError(
                f"expected a radiance for each of {len(time)} keys, got shape {wanted.shape}"
            )
        where = np.array(np.broadcast_to(np.asarray(place, dtype=np.intp), time.shape))
        is_proper = np.isfinite(time) & np.isfinite(wanted).all(axis=1)
        if not is_proper.all():
            raise UsageError(
                f"expected finite numbers, got NaN or an infinite one in key "
                f"{int(np.argmin(is_proper)) + 1}"
            )
        if np.abs(wanted).max() > STRONGEST:
            raise UsageError(f"expected radiances up to {STRONGEST:g}, got {wanted.max():g}")
        wanted = np.where(np.abs(wanted) < BLACK, 0.0, wanted)
        order = np.lexsort((time, where))
        for first, second in itertools.pairwise(order):
            if where[first] == where[second] and time[first] == time[second]:
                _refuse_contradiction(first, second, time, wanted)
        return cls(where, time, wanted)

    @classmethod
    def none(cls) -> Self:
        """Return no keys: nothing is wanted yet, and a material can only be looked at."""
        return cls(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 3)))

    def at_places(self, places: Sequence[int]) -> Self:
        """Return the keys at some places only, in their order."""
        own = np.isin(self.place, places)
        return replace(self, place=self.place[own], time_s=self.time_s[own],
                       radiance=self.radiance[own])  # fmt: skip

    @property
    def count(self) -> int:
        """Number of keys."""
        return len(self.time_s)

    def rgb(self, bands: DesignBands) -> FloatArray:
        """Return the wanted radiances in linear sRGB per sr, shape (m, 3)."""
        return self.radiance if self.is_colour(bands) else self.radiance @ bands.to_rgb.T

    def is_colour(self, bands: DesignBands) -> bool:
        """Return whether the radiances are colours and not light in the bands."""
        width = self.radiance.shape[1]
        if width not in (3, bands.count):
            raise UsageError(
                f"expected radiances of 3 channels or {bands.count} bands, got {width}"
            )
        return bands.edges_nm is not None and width == 3

    def luminance(self, bands: DesignBands) -> FloatArray:
        """Return the luminances by which keys count, in the unit of the radiances, shape (m,).

        A black key counts as the faintest other one. That of light in bands is its mean, weighted
        as eyes see the bands.
        """
        seen = RGB_TO_Y if self.is_colour(bands) else RGB_TO_Y @ bands.to_rgb
        weights = np.maximum(seen, 0.0)
        if not weights.any():
            weights = np.ones_like(weights)
        return _with_floor(self.radiance @ (weights / weights.sum()))

    def weights(self, bands: DesignBands, kind: Literal["luminance", "plain"]) -> FloatArray:
        """Return by what differences to the keys are multiplied, shape (m,).

        Parameters
        ----------
        bands
            Bands of the design.
        kind
            `luminance`: relative to each key's own luminance; `plain`: all alike, as in eq. 7.
        """
        luminance = self.luminance(bands)
        if kind == "plain":
            return np.full_like(luminance, 1 / luminance.max(initial=1e-300))
        return 1 / luminance

    def screen_luminance(self, bands: DesignBands) -> FloatArray:
        """Return the luminances by which differences of colours are judged, shape (m,).

        They are those of linear sRGB; a black key is judged as the faintest other one.
        """
        return _with_floor(self.rgb(bands) @ RGB_TO_Y)


def _with_floor(y: FloatArray) -> FloatArray:
    """Return luminances, those of black keys replaced by the least of the others."""
    is_black = y <= FLOOR * max(float(y.max(initial=0.0)), 0.0)
    if is_black.all():
        return np.ones_like(y)
    return np.where(is_black, y[~is_black].min(), y)


def _refuse_contradiction(
    first: np.intp, second: np.intp, time_s: FloatArray, wanted: FloatArray
) -> None:
    scale = np.abs(wanted[[first, second]]).max()
    if np.abs(wanted[first] - wanted[second]).max() > SAME * scale:
        # In the unit of files, in which a white card is 1.
        mean = np.pi * (wanted[first] + wanted[second]) / 2
        raise UsageError(
            f"expected one wish for each place and time, got two different ones at "
            f"{time_s[first]:g} s (keys {first + 1} and {second + 1}); the nearest to both is "
            f"{np.array2string(mean, precision=4, separator=', ')}"
        )
