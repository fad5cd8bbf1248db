"""Reflectance and re-radiation in measured columns, where they can be told apart.

Beyond the band of a light all that comes back is re-radiated. Within it both come together: the
reflectance there is told by the light itself, less what may be re-radiated, and the re-radiation
only where another light tells the reflectance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit.bispectral.columns import BispectralColumns
from labrig.foundation.arrays import FloatArray
from labrig.optics import edges_from_centres

#: Least part of a light in a band from which its reflectance is read.
LEAST_SHARE = 0.03
#: Part of a light in a band from which reflected light is more than a correction.
MIXED_SHARE = 1e-3
#: Mean and σ of a reflectance of which nothing is known, even between 0 and 1; and the part of a
#: light in a band up to which that is enough to tell re-radiation.
UNKNOWN_REFLECTANCE = 0.5, 1 / np.sqrt(12)
LITTLE_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class SeparatedColumns:
    """Columns of m lights in k bands, taken apart.

    Attributes
    ----------
    reflectance, reflectance_sigma : ndarray, shape (k,)
        Reflectance at the centre of each band and σ; NaN where no light is.
    reradiated, reradiated_sigma : ndarray, shape (k, m)
        Re-radiated part of the column and σ; NaN where it cannot be told from reflected light.
    is_mixed : ndarray, shape (k, m)
        Whether the light itself is in that band, so that the re-radiation rests on the reflectance
        that another light tells, or is not known.
    """

    reflectance: FloatArray
    reflectance_sigma: FloatArray
    reradiated: FloatArray
    reradiated_sigma: FloatArray
    is_mixed: NDArray[np.bool_]


def separate_columns(columns: BispectralColumns) -> SeparatedColumns:
    """Take reflected and re-radiated light in columns apart.

    Where a light has little of its power, an unknown reflectance is taken as any from 0 to 1. In
    its own band a light is reflected and may excite re-radiation, which is between none and what
    the emission under a light of shorter wavelength extrapolates to (Kasha's rule: emission has one
    shape whatever excites it). Half of that is subtracted from the reflectance, and σ holds the
    other half.

    Parameters
    ----------
    columns
        Columns of a sample under all lights.

    Returns
    -------
    SeparatedColumns
        Reflectance, re-radiation, and where both are mixed.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import LitSpectrum, bispectral_columns, separate_columns
    >>> nm = np.arange(380.0, 781.0, 2.0)
    >>> blue, noise = np.exp(-(((nm - 450) / 12) ** 2)), np.full(len(nm), 1e-4)
    >>> green = np.exp(-(((nm - 540) / 30) ** 2))
    >>> white, cloth = (LitSpectrum(nm, light, noise) for light in (blue, 0.3 * blue + 0.1 * green))
    >>> columns = bispectral_columns([white], [cloth], np.arange(430.0, 600.0, 20.0))
    >>> separated = separate_columns(columns)
    >>> separated.is_mixed[:3, 0].tolist()
    [True, True, True]
    >>> [round(float(value), 2) for value in separated.reradiated[3:7, 0]]
    [0.01, 0.04, 0.08, 0.08]
    """
    share, column = columns.share, columns.column
    is_mixed = share >= np.maximum(MIXED_SHARE, 3 * columns.share_sigma)
    own = _own_reradiation(columns, is_mixed)
    is_read = share >= LEAST_SHARE
    part = np.where(is_read, share, 1.0)
    ratio = np.where(is_read, (column - own / 2) / part, np.nan)
    relative = np.hypot(columns.column_sigma, ratio * columns.share_sigma) / part
    sigma = np.where(is_read, np.hypot(relative, own / part / 2), np.inf)

    main = sigma.argmin(axis=1)
    slope = _slopes(columns, ratio, main)
    reflectance, reflectance_sigma = _at(columns, ratio, sigma, main, slope, columns.output_nm)
    reradiated, reradiated_sigma = np.full_like(column, np.nan), np.full_like(column, np.nan)
    for light in range(column.shape[1]):
        others = sigma.copy()
        others[:, light] = np.inf
        known, known_sigma = _at(
            columns, ratio, others, others.argmin(axis=1), slope, columns.centroid_nm[:, light]
        )
        small = np.isnan(known) & (share[:, light] < LITTLE_SHARE)
        known = np.where(small, UNKNOWN_REFLECTANCE[0], known)
        known_sigma = np.where(small, UNKNOWN_REFLECTANCE[1], known_sigma)
        is_seen = share[:, light] > 3 * columns.share_sigma[:, light]
        is_lit = is_seen | _in_window(columns, light)
        lit = np.where(is_lit, share[:, light], 0.0)
        lit_sigma = np.where(is_lit, columns.share_sigma[:, light], 0.0)
        reradiated[:, light] = column[:, light] - known * lit
        parts = np.hypot(known_sigma * lit, known * lit_sigma)
        reradiated_sigma[:, light] = np.hypot(columns.column_sigma[:, light], parts)
    return SeparatedColumns(
        reflectance,
        reflectance_sigma,
        np.where(np.isfinite(reradiated_sigma), reradiated, np.nan),
        np.where(np.isfinite(reradiated), reradiated_sigma, np.nan),
        is_mixed,
    )


def _own_reradiation(columns: BispectralColumns, is_mixed: NDArray[np.bool_]) -> FloatArray:
    """Return the most that a light's column may hold of re-radiation in its own band, (k, m)."""
    column = np.maximum(columns.column, 0.0)
    own = np.zeros_like(column)
    for light in range(column.shape[1]):
        beyond = ~is_mixed[:, light] & (columns.output_nm > columns.light_nm[light])
        for band in np.flatnonzero(is_mixed[:, light]):
            clear = np.flatnonzero(~is_mixed[band, :light])
            reference = clear[-1] if len(clear) else None
            shared = beyond if reference is None else beyond & ~is_mixed[:, reference]
            if not shared.any():
                continue
            if reference is None:
                # Nothing of shorter wavelength tells the emission here: as much as next to it.
                own[band, light] = column[np.flatnonzero(shared)[0], light]
                continue
            weight = column[shared, reference]
            amount = weight @ column[shared, light] / max(weight @ weight, 1e-300)
            own[band, light] = amount * column[band, reference]
    return own


def _in_window(columns: BispectralColumns, light: int) -> NDArray[np.bool_]:
    """Return whether each band overlaps the range of a light."""
    edges_nm = edges_from_centres(columns.output_nm)
    low_nm, high_nm = columns.window_nm[light]
    return np.asarray((edges_nm[1:] > low_nm) & (edges_nm[:-1] < high_nm))


def _slopes(columns: BispectralColumns, ratio: FloatArray, main: NDArray[np.intp]) -> FloatArray:
    """Return the change of the reflectance per nm about each band, shape (k,); 0 if unknown."""
    bands = np.arange(len(main))
    value, place_nm = ratio[bands, main], columns.centroid_nm[bands, main]
    known = np.isfinite(value)
    slope = np.zeros(len(main))
    if known.sum() >= 3:
        slope[known] = np.gradient(value[known], place_nm[known])
    return slope


def _at(
    columns: BispectralColumns,
    ratio: FloatArray,
    sigma: FloatArray,
    chosen: NDArray[np.intp],
    slope: FloatArray,
    place_nm: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the reflectance that chosen lights tell, and σ, at a wavelength of each band."""
    bands = np.arange(len(chosen))
    away = slope * (place_nm - columns.centroid_nm[bands, chosen])
    value, value_sigma = ratio[bands, chosen] + away, np.hypot(sigma[bands, chosen], away / 2)
    known = np.isfinite(sigma[bands, chosen])
    return np.where(known, value, np.nan), np.where(known, value_sigma, np.nan)
