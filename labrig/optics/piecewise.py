"""Integrals of measured curves, exact for curves that are piecewise linear between their points.

Sampling a curve on a coarse grid loses the structure between the samples (all of a line 1 nm wide
on a 10 nm grid); integration keeps it.
"""

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray

#: Widest cell of a quadrature, so that smooth factors (a filter's band) are integrated to 1e-9.
CELL_NM = 1.0
#: Gauss–Legendre nodes a cell: exact for a product of five straight lines.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)


def band_integrals(
    wavelength_nm: FloatArray, values: FloatArray, edges_nm: ArrayLike
) -> FloatArray:
    """Integrate curves over neighbouring bands, ∫ f dλ.

    A curve is piecewise linear between its wavelengths and zero outside of them.

    Parameters
    ----------
    wavelength_nm
        Rising wavelengths in nm, shape (n,).
    values
        Values of one curve, shape (n,), or of k curves, shape (n, k).
    edges_nm
        Rising edges of the bands in nm, shape (b + 1,).

    Returns
    -------
    ndarray
        Integrals in the unit of the values times nm, shape (b,) or (b, k).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import band_integrals
    >>> wavelength_nm, line = np.array([549.5, 550.0, 550.5]), np.array([0.0, 1.0, 0.0])
    >>> band_integrals(wavelength_nm, line, [500, 550, 600]).tolist()
    [0.25, 0.25]
    """
    edges = np.asarray(edges_nm, dtype=np.float64)
    step = np.diff(wavelength_nm).reshape(-1, *[1] * (values.ndim - 1))
    cumulative = np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(step * (values[1:] + values[:-1]) / 2, axis=0)]
    )
    inside = np.clip(edges, wavelength_nm[0], wavelength_nm[-1])
    cell = np.clip(
        np.searchsorted(wavelength_nm, inside, side="right") - 1, 0, len(wavelength_nm) - 2
    )
    x = (inside - wavelength_nm[cell]).reshape(-1, *[1] * (values.ndim - 1))
    slope = (values[cell + 1] - values[cell]) / step[cell]
    integrals: FloatArray = np.diff(cumulative[cell] + x * values[cell] + x**2 / 2 * slope, axis=0)
    return integrals


def band_means(wavelength_nm: FloatArray, values: FloatArray, edges_nm: ArrayLike) -> FloatArray:
    """Average curves over neighbouring bands.

    Parameters
    ----------
    wavelength_nm
        Rising wavelengths in nm, shape (n,).
    values
        Values of one curve, shape (n,), or of k curves, shape (n, k).
    edges_nm
        Rising edges of the bands in nm, shape (b + 1,).

    Returns
    -------
    ndarray
        Integral of each band over its width, in the unit of the values, shape (b,) or (b, k).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import band_means
    >>> band_means(np.array([400.0, 600.0]), np.array([0.0, 1.0]), [400, 500, 600]).tolist()
    [0.25, 0.75]
    """
    width = np.diff(np.asarray(edges_nm, dtype=np.float64))
    means: FloatArray = band_integrals(wavelength_nm, values, edges_nm) / width.reshape(
        -1, *[1] * (values.ndim - 1)
    )
    return means


def edges_from_centres(centre_nm: ArrayLike) -> FloatArray:
    """Return the edges half-way between rising centres.

    Parameters
    ----------
    centre_nm
        Rising centre wavelengths in nm, shape (n,) with n ≥ 2.

    Returns
    -------
    ndarray
        Edges in nm, shape (n + 1,); the outermost bands are symmetric about their centres.

    Examples
    --------
    >>> from labrig.optics import edges_from_centres
    >>> edges_from_centres([400, 420, 460]).tolist()
    [390.0, 410.0, 440.0, 480.0]
    """
    centre = np.asarray(centre_nm, dtype=np.float64)
    between = (centre[1:] + centre[:-1]) / 2
    return np.concatenate([[2 * centre[0] - between[0]], between, [2 * centre[-1] - between[-1]]])


def quadrature(
    low_nm: float, high_nm: float, *knots_nm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of ∫ f dλ for piecewise-linear factors.

    Three Gauss–Legendre nodes per cell make it exact for products of up to five curves whose points
    are all among `knots_nm`.

    Parameters
    ----------
    low_nm, high_nm
        Limits of the integral in nm.
    *knots_nm
        Wavelengths in nm at which the factors have their points, each of shape (n,).

    Returns
    -------
    nodes_nm : ndarray
        Wavelengths in nm, shape (q,).
    weights_nm : ndarray
        Weights in nm, shape (q,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import quadrature
    >>> nodes_nm, weights_nm = quadrature(400.0, 700.0, np.array([450.0, 520.5]))
    >>> f"{weights_nm.sum():.6f}", f"{weights_nm @ nodes_nm:.3f}"
    ('300.000000', '165000.000')
    """
    even = np.linspace(low_nm, high_nm, int(np.ceil((high_nm - low_nm) / CELL_NM)) + 1)
    knots = np.concatenate([even, *knots_nm])
    knots = np.unique(knots[(knots >= low_nm) & (knots <= high_nm)])
    half = np.diff(knots)[:, np.newaxis] / 2
    nodes = (knots[:-1, np.newaxis] + half) + half * NODES
    return nodes.ravel(), (half * WEIGHTS).ravel()


def hat_functions(knots_nm: FloatArray, wavelength_nm: FloatArray) -> FloatArray:
    """Evaluate the hat functions of a grid.

    A hat function is 1 at its own knot and 0 at all others; they span all piecewise-linear curves
    on the grid and vanish outside of it.

    Parameters
    ----------
    knots_nm
        Rising knots in nm, shape (n,) with n ≥ 2.
    wavelength_nm
        Wavelengths in nm, shape (q,).

    Returns
    -------
    ndarray
        Value of each hat function at each wavelength, shape (q, n).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import hat_functions
    >>> hat_functions(np.array([400.0, 500.0, 600.0]), np.array([425.0, 500.0, 650.0])).tolist()
    [[0.75, 0.25, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
    """
    cell = np.clip(np.searchsorted(knots_nm, wavelength_nm, side="right") - 1, 0, len(knots_nm) - 2)
    fraction = (wavelength_nm - knots_nm[cell]) / (knots_nm[cell + 1] - knots_nm[cell])
    inside = (fraction >= 0) & (fraction <= 1)
    values = np.zeros((len(wavelength_nm), len(knots_nm)))
    rows = np.flatnonzero(inside)
    values[rows, cell[rows]] = 1 - fraction[rows]
    values[rows, cell[rows] + 1] += fraction[rows]
    return values
