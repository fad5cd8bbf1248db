"""The light that falls on the places of a design over time."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError

#: Irradiance below which it is dark, and largest one; 1 is a light that makes a card white.
DARK, STRONGEST = 1e-12, 1e12
#: Relative difference of two times that is rounding.
ROUNDED = 1e-12


@dataclass(frozen=True, eq=False)
class LightProgramme:
    """Irradiance on one or more places, constant from one time to the next.

    Attributes
    ----------
    begin_s
        Rising times in s from which each light is on; the last one stays on. Before the first all
        was dark for long, and states are empty. Shape (n,).
    irradiance
        Irradiance in the bands, ≥ 0, shape (places, n, bands).
    """

    begin_s: FloatArray
    irradiance: FloatArray

    @classmethod
    def checked(cls, begin_s: ArrayLike, irradiance: ArrayLike) -> Self:
        """Return a programme whose shapes and ranges were checked; below 1e-12 it is dark.

        Parameters
        ----------
        begin_s
            Times, shape (n,).
        irradiance
            Irradiance, shape (n, bands) of one place or (places, n, bands).

        Raises
        ------
        UsageError
            Shapes disagree, times do not rise, or a value is negative or not finite.
        """
        begin = np.asarray(begin_s, dtype=np.float64)
        light = np.asarray(irradiance, dtype=np.float64)
        light = light[np.newaxis] if light.ndim == 2 else light
        if begin.ndim != 1 or not len(begin) or light.ndim != 3 or light.shape[1] != len(begin):
            raise UsageError(
                f"expected one irradiance for each of {begin.size} times, got shape {light.shape}"
            )
        if not np.isfinite(begin).all() or (np.diff(begin) <= 0).any():
            raise UsageError("expected rising times in the light programme, got others")
        if not (np.isfinite(light).all() and light.min() >= 0):
            raise UsageError("expected irradiances that are finite and ≥ 0, got others")
        if light.max() > STRONGEST:
            raise UsageError(f"expected irradiances up to {STRONGEST:g}, got {light.max():g}")
        return cls(begin, np.where(light < DARK, 0.0, light))

    @property
    def n_places(self) -> int:
        """Number of places."""
        return len(self.irradiance)

    def at(self, place: NDArray[np.intp], time_s: FloatArray) -> FloatArray:
        """Return the irradiance at places (m,) and times (m,), shape (m, bands).

        At the time of a change it is the light that begins.
        """
        index = np.searchsorted(self.begin_s, time_s, side="right") - 1
        lit = self.irradiance[place, np.maximum(index, 0)]
        return np.where((index >= 0)[:, np.newaxis], lit, 0.0)


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps of constant light on one place, which end at every key of that place.

    Attributes
    ----------
    duration_s
        Lengths of the steps in s, shape (n,).
    irradiance
        Irradiance during each step, shape (n, bands).
    keys
        Indices of the keys of this place, shape (k,).
    taken
        Number of steps before each of these keys, shape (k,).
    """

    duration_s: FloatArray
    irradiance: FloatArray
    keys: NDArray[np.intp]
    taken: NDArray[np.intp]


def steps_to(
    programme: LightProgramme, place: NDArray[np.intp], time_s: FloatArray
) -> tuple[Steps, ...]:
    """Return the steps of each place that has keys, as few as there may be."""
    found = []
    for number in np.unique(place):
        keys = np.flatnonzero(place == number)
        light = programme.irradiance[number]
        is_new = np.concatenate([[True], (np.diff(light, axis=0) != 0).any(axis=1)])
        begin = programme.begin_s[is_new]
        last = max(float(time_s[keys].max()), float(begin[0]))
        edges = np.unique(np.concatenate([begin[begin < last], time_s[keys], begin[:1]]))
        edges = edges[edges >= begin[0]]
        # A key at a change of light may differ from it by rounding.
        same = ROUNDED * (abs(begin[0]) + last)
        edges = edges[np.concatenate([[True], np.diff(edges) > same])]
        at = np.searchsorted(begin, edges[:-1] + same, side="right") - 1
        taken = np.maximum(np.searchsorted(edges, time_s[keys] + same, side="right") - 1, 0)
        found.append(Steps(np.diff(edges), light[is_new][at], keys, taken))
    return tuple(found)
