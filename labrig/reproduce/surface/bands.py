"""Wavelength bands of a rendering, and how spectra and measured materials are brought into them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import Spectrum

#: Bands of a rendering where nobody says otherwise: 20 nm wide, ultraviolet included.
FIRST_NM, LAST_NM, COUNT = 300.0, 780.0, 24


@dataclass(frozen=True, eq=False)
class Bands:
    """Neighbouring wavelength bands, in each of which all spectra are constant.

    Attributes
    ----------
    edges_nm
        Rising edges in nm, shape (bands + 1,).

    Examples
    --------
    >>> from labrig.optics import read_light
    >>> from labrig.reproduce import Bands
    >>> bands = Bands.even()
    >>> len(bands), bands.centre_nm[:2].tolist()
    (24, [310.0, 330.0])
    >>> round(float(bands.means(read_light("450nm")).max()), 3)
    0.5
    """

    edges_nm: FloatArray

    @classmethod
    def even(cls, first_nm: float = FIRST_NM, last_nm: float = LAST_NM, count: int = COUNT) -> Self:
        """Return bands of equal width.

        Parameters
        ----------
        first_nm, last_nm
            First and last edge in nm.
        count
            Number of bands, two or more.

        Raises
        ------
        UsageError
            The edges do not rise, or there are fewer than two bands.
        """
        if not 0 < first_nm < last_nm or count < 2:
            raise UsageError(
                f"expected two or more bands between rising wavelengths, got {count} from "
                f"{first_nm:g} nm to {last_nm:g} nm"
            )
        return cls(np.linspace(first_nm, last_nm, count + 1))

    def __len__(self) -> int:
        return len(self.edges_nm) - 1

    @cached_property
    def centre_nm(self) -> FloatArray:
        """Middles of the bands in nm, shape (bands,)."""
        return np.array([(low + high) / 2 for low, high in pairwise(self.edges_nm)])

    @cached_property
    def width_nm(self) -> FloatArray:
        """Widths of the bands in nm, shape (bands,)."""
        return np.diff(self.edges_nm)

    def means(self, light: Spectrum) -> FloatArray:
        """Return the mean of a spectrum in each band, zero where it was not measured (bands,)."""
        return light.in_bands(self.edges_nm)

    def overlap_nm(self, edges_nm: ArrayLike) -> FloatArray:
        """Return how many nm each of these bands shares with each of some others.

        Parameters
        ----------
        edges_nm
            Rising edges of the other bands in nm, shape (others + 1,).

        Returns
        -------
        ndarray
            Widths in nm, shape (others, bands).
        """
        edges = np.asarray(edges_nm, dtype=np.float64)[:, None]
        high = np.minimum(edges[1:], self.edges_nm[1:])
        low = np.maximum(edges[:-1], self.edges_nm[:-1])
        return np.asarray(np.maximum(high - low, 0.0))
