"""Integrals of measured curves, exact for straight lines between their points.

A curve is piecewise linear between the wavelengths where it was measured. Sampling it at a coarse
grid loses what lies between (a line 1 nm wide on a 10 nm grid, all of it); integrating does not.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

#: Widest cell of a quadrature, so that smooth factors (a filter's band) are integrated to 1e-9.
CELL_NM = 1.0
#: Gauss–Legendre nodes a cell: exact for a product of five straight lines.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)


def band_integrals(
    wavelength_nm: FloatArray, values: FloatArray, edges_nm: ArrayLike
) -> FloatArray:
    """∫ f dλ over neighbouring bands; f is zero outside of its wavelengths.

    Parameters
    ----------
    wavelength_nm
        (n,) rising.
    values
        (n,) or (n, k).
    edges_nm
        (b + 1,) rising.

    Returns
    -------
    (b,) or (b, k).
    """
    edges = np.asarray(edges_nm, dtype=np.float64)
    step = np.diff(wavelength_nm).reshape(-1, *[1] * (values.ndim - 1))
    until = np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(step * (values[1:] + values[:-1]) / 2, axis=0)]
    )
    inside = np.clip(edges, wavelength_nm[0], wavelength_nm[-1])
    left = np.clip(
        np.searchsorted(wavelength_nm, inside, side="right") - 1, 0, len(wavelength_nm) - 2
    )
    x = (inside - wavelength_nm[left]).reshape(-1, *[1] * (values.ndim - 1))
    slope = (values[left + 1] - values[left]) / step[left]
    integrals: FloatArray = np.diff(until[left] + x * values[left] + x**2 / 2 * slope, axis=0)
    return integrals


def band_means(wavelength_nm: FloatArray, values: FloatArray, edges_nm: ArrayLike) -> FloatArray:
    """Mean of f over neighbouring bands, as `band_integrals`."""
    width = np.diff(np.asarray(edges_nm, dtype=np.float64))
    means: FloatArray = band_integrals(wavelength_nm, values, edges_nm) / width.reshape(
        -1, *[1] * (values.ndim - 1)
    )
    return means


def edges_about(centre_nm: ArrayLike) -> FloatArray:
    """Edges (n + 1,) half-way between (n,) rising centres, symmetric about the outermost."""
    centre = np.asarray(centre_nm, dtype=np.float64)
    between = (centre[1:] + centre[:-1]) / 2
    return np.concatenate([[2 * centre[0] - between[0]], between, [2 * centre[-1] - between[-1]]])


def quadrature(
    low_nm: float, high_nm: float, *knots_nm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of ∫ f dλ from `low_nm` to `high_nm`.

    Exact for products of up to five curves whose points are all among `knots_nm`.

    Returns
    -------
    (q,) wavelengths and (q,) weights in nm.
    """
    even = np.linspace(low_nm, high_nm, int(np.ceil((high_nm - low_nm) / CELL_NM)) + 1)
    knots = np.concatenate([even, *knots_nm])
    knots = np.unique(knots[(knots >= low_nm) & (knots <= high_nm)])
    half = np.diff(knots)[:, np.newaxis] / 2
    nodes = (knots[:-1, np.newaxis] + half) + half * NODES
    return nodes.ravel(), (half * WEIGHTS).ravel()


def hats(knots_nm: FloatArray, wavelength_nm: FloatArray) -> FloatArray:
    """The tent functions of a grid at (q,) wavelengths, shape (q, n): 1 at their own knot.

    They span all piecewise-linear curves on the grid; outside of it they are zero.
    """
    left = np.clip(np.searchsorted(knots_nm, wavelength_nm, side="right") - 1, 0, len(knots_nm) - 2)
    fraction = (wavelength_nm - knots_nm[left]) / (knots_nm[left + 1] - knots_nm[left])
    inside = (fraction >= 0) & (fraction <= 1)
    values = np.zeros((len(wavelength_nm), len(knots_nm)))
    rows = np.flatnonzero(inside)
    values[rows, left[rows]] = 1 - fraction[rows]
    values[rows, left[rows] + 1] += fraction[rows]
    return values
