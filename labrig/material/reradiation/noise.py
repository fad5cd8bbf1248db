"""Uncertainties of a measured re-radiation matrix, from entries where no light can be.

No surface re-radiates at wavelengths well below the light's, so what an instrument finds there is
its noise. On 196 measurements of ceramic tiles with a Labsphere BFC-450 and on 97 other samples,
the noise is a factor of the input band times one of the output band. It hardly depends on the
sample, and about three quarters of its variance are common to a whole column: σ is that of single
entries, and sums over a column are less certain than independent entries would be.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError
from labrig.material.reradiation.matrix import ReradiationMatrix

#: Entries nearer to the diagonal than this many bands hold light that passes both monochromators.
CLEAR_BANDS = 1.5
#: Entries beyond this many times the column's median are no noise; of 10⁹ normal ones, 2 are.
CLIP_SIGMAS = 6.0
#: Normal σ over the median of the absolute values.
SIGMA_OF_MEDIAN = 1.4826
#: Weight of what is expected of a column, in entries. With 4, rms pulls of held-out tiles are 0.96
#: to 1.03 in all regions; with 1 they are up to 1.12, with 16 down to 0.93.
EXPECTED_ENTRIES = 4.0
#: Entries that are averaged for what is expected of a column, and for a row's factor.
POOLED_COLUMN_ENTRIES, POOLED_ROW_ENTRIES = 10, 15
#: The parabola of the rows ends where fewer entries than this are known, and goes on level. With 4,
#: rms pulls of tiles at 700 to 780 nm are 1.08; to the end, a parabola has 0.94 and scatters more.
LAST_ROW_ENTRIES = 4
#: σ of the columns 300 to 390 nm (rms over them) over that of the nearest columns with an
#: anti-Stokes side is 1.1 on the tiles; the column of 300 nm alone is 2 times as noisy.
UNSEEN_COLUMN_RATIO = 1.2
#: Scatter of a tile's reflectance beyond the noise: a part of it, and a wrong wavelength.
REFLECTANCE_SCATTER = 0.0016
WAVELENGTH_SCATTER_NM = 0.2
ITERATIONS = 10
#: Correlation of any two entries of a column: what makes the scatter of sums over columns.
COLUMN_CORRELATION = 0.55


@dataclass(frozen=True, eq=False)
class InstrumentNoise:
    """Noise of an instrument: one standard deviation of an entry is the product of two factors.

    Attributes
    ----------
    input_nm, output_nm
        Centres of the bands in nm, shapes (m,) and (n,).
    column_sigma
        σ of each input band, as fraction of its light per output band, shape (m,).
    row_factor
        Factor of each output band, with a median of 1, shape (n,).
    """

    input_nm: FloatArray
    output_nm: FloatArray
    column_sigma: FloatArray
    row_factor: FloatArray


def instrument_noise(samples: Sequence[ReradiationMatrix]) -> InstrumentNoise:
    """Return the noise of an instrument from samples that do not re-radiate.

    Parameters
    ----------
    samples
        Matrices of samples without fluorescence, such as ceramic tiles, measured on the same bands.
        The same sample may be there many times: fixed offsets count as noise, too.

    Returns
    -------
    InstrumentNoise
        Root mean squares of the entries two or more bands off the diagonal.

    Raises
    ------
    DataError
        There is no sample, or some input band has no entry off the diagonal.
    ValueError
        Bands of the samples differ.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, instrument_noise
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> noise = 0.001 * np.random.default_rng(1).standard_normal((30, 31, 31))
    >>> tiles = [
    ...     ReradiationMatrix.from_bands("tile", nm, nm, 0.5 * np.eye(31) + one) for one in noise
    ... ]
    >>> round(float(instrument_noise(tiles).column_sigma.mean()), 4)
    0.001
    """
    if not samples:
        raise DataError("expected samples that do not re-radiate, got none: give one or more")
    first = samples[0]
    for sample in samples[1:]:
        if not _same_bands(sample, first):
            raise ValueError(f"expected the bands of {first.name!r} in {sample.name!r}, too")
    values = np.array([_band_values(sample) for sample in samples])
    used = ~near_diagonal(first) & np.isfinite(values)
    used &= np.abs(values) <= _clip_limit(values, used)
    squares, counts = np.where(used, values**2, 0.0).sum(axis=0), used.sum(axis=0)
    if (counts.sum(axis=0) == 0).any():
        empty = first.input_nm[counts.sum(axis=0) == 0][0]
        raise DataError(
            f"expected samples with entries off the diagonal at every input wavelength, got none "
            f"at {empty:g} nm: measure longer or shorter wavelengths, too"
        )
    factor = np.ones(len(first.output_nm))
    for _ in range(ITERATIONS):
        column = _ratio((squares / factor[:, np.newaxis] ** 2).sum(axis=0), counts.sum(axis=0))
        factor = _normalised(_pooled(_ratio(squares, column).sum(axis=1), counts.sum(axis=1)))
    column = (squares / factor[:, np.newaxis] ** 2).sum(axis=0) / counts.sum(axis=0)
    return InstrumentNoise(first.input_nm, first.output_nm, np.sqrt(column), factor)


def with_sigma(
    matrix: ReradiationMatrix, noise: InstrumentNoise | None = None
) -> ReradiationMatrix:
    """Return a measured matrix with one standard deviation of each number.

    Parameters
    ----------
    matrix
        A matrix as measured: its anti-Stokes side, two or more bands from the diagonal, is noise.
    noise
        Noise of its instrument from `instrument_noise`. Without it, columns without an anti-Stokes
        side are taken 1.2 times as noisy as their nearest neighbours, and the logarithm of the
        factor of output bands is taken for a parabola, level where nothing is known.

    Returns
    -------
    ReradiationMatrix
        The same numbers. σ of re-radiation is a product of factors of input and output band; that
        of reflectance also has 0.16 % of it and an uncertainty of 0.2 nm of the wavelength.

    Raises
    ------
    DataError
        The matrix has too few anti-Stokes entries and no noise is given, it is without any noise
        (so it is not as measured), or the noise is for other bands.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, with_sigma
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> noise = 0.001 * np.random.default_rng(1).standard_normal((31, 31))
    >>> paper = ReradiationMatrix.from_bands("paper", nm, nm, 0.5 * np.eye(31) + noise)
    >>> sigma = with_sigma(paper).reradiation_sigma * 10
    >>> round(float(sigma[20, 15]), 3)
    0.001
    """
    if noise is not None and not _same_bands(matrix, noise):
        raise DataError(
            f"expected noise on the bands of {matrix.name!r}, got it on others: "
            "take repeats that were measured on the same wavelengths"
        )
    values, used = _band_values(matrix), clear_anti_stokes(matrix)
    squares, counts = np.where(used, values**2, 0.0), used.sum(axis=0)
    if noise is None and counts.sum() < POOLED_ROW_ENTRIES:
        raise DataError(
            f"expected {POOLED_ROW_ENTRIES} or more anti-Stokes entries in {matrix.name!r}, got "
            f"{counts.sum()}: give repeats of samples that do not re-radiate"
        )
    if noise is None and not squares.any():
        raise DataError(
            f"expected noise on the anti-Stokes side of {matrix.name!r}, got zeros only: "
            "take the matrix as it was measured, or give repeats"
        )
    if noise is None:
        factor, variance = _own_noise(squares, used, matrix.output_nm)
    else:
        factor = noise.row_factor
        variance = _column_variance(squares, counts, factor, noise.column_sigma**2)
    sigma = factor[:, np.newaxis] * np.sqrt(variance)
    return replace(
        matrix,
        reflectance_sigma=_reflectance_sigma(matrix, sigma),
        reradiation_sigma=sigma / matrix.output_width_nm[:, np.newaxis],
        column_correlation=np.full(len(matrix.input_nm), COLUMN_CORRELATION),
    )


def required_sigma(matrix: ReradiationMatrix) -> FloatArray:
    """Return σ of the re-radiation; raise DataError if it is not known."""
    if matrix.reradiation_sigma is None:
        raise DataError(
            f"expected σ of the re-radiation of {matrix.name!r}, got none: estimate it first"
        )
    return matrix.reradiation_sigma


def clear_anti_stokes(matrix: ReradiationMatrix) -> BoolArray:
    """Return which entries are noise: two or more bands on the anti-Stokes side, (n, m)."""
    values = _band_values(matrix)
    used = ~matrix.is_stokes & ~near_diagonal(matrix) & np.isfinite(values)
    return used & (np.abs(values) <= _clip_limit(values, used))


def _own_noise(
    squares: FloatArray, used: BoolArray, output_nm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the rows' factor and the columns' variance, from one matrix alone."""
    factor = np.ones(len(output_nm))
    for _ in range(ITERATIONS):
        variance = _column_variance(squares, used.sum(axis=0), factor, None)
        rows = _ratio(squares, variance).sum(axis=1)
        factor = _normalised(_parabola(rows, used.sum(axis=1), output_nm))
    return factor, _column_variance(squares, used.sum(axis=0), factor, None)


def _column_variance(
    squares: FloatArray,
    counts: NDArray[np.int64],
    factor: FloatArray,
    expected: FloatArray | None,
) -> FloatArray:
    """Return each column's variance, drawn towards the expected or its neighbours' one."""
    sums = (squares / factor[:, np.newaxis] ** 2).sum(axis=0)
    if expected is None:
        near = _pooled(sums, counts, POOLED_COLUMN_ENTRIES)
        expected = np.where(counts > 0, near, UNSEEN_COLUMN_RATIO**2 * near)
    return np.asarray((sums + EXPECTED_ENTRIES * expected) / (counts + EXPECTED_ENTRIES))


def _reflectance_sigma(matrix: ReradiationMatrix, sigma: FloatArray) -> FloatArray:
    """Return σ of the reflectance from that of the entries in the same rows."""
    rows = zip(matrix.output_nm, sigma, strict=True)
    own = np.array([np.interp(nm, matrix.input_nm, row) for nm, row in rows])
    known = np.flatnonzero(~np.isnan(matrix.reflectance))
    result = np.full(len(own), np.nan)
    if len(known) > 0:
        reflectance = matrix.reflectance[known]
        nm = matrix.output_nm[known]
        slope = np.gradient(reflectance, nm) if len(known) > 1 else np.zeros(1)
        result[known] = np.sqrt(
            own[known] ** 2
            + (REFLECTANCE_SCATTER * reflectance) ** 2
            + (WAVELENGTH_SCATTER_NM * slope) ** 2
        )
    return result


def _pooled(
    sums: FloatArray, counts: NDArray[np.int64], entries: int = POOLED_ROW_ENTRIES
) -> FloatArray:
    """Return means over five neighbours, or as many as have `entries`."""
    means = np.empty(len(sums))
    for index in range(len(sums)):
        for reach in range(2, len(sums) + 2):
            near = slice(max(index - reach, 0), index + reach + 1)
            if counts[near].sum() >= entries:
                break
        means[index] = sums[near].sum() / max(counts[near].sum(), 1)
    return means


def _parabola(sums: FloatArray, counts: NDArray[np.int64], wavelength_nm: FloatArray) -> FloatArray:
    """Return mean squares whose logarithm is a parabola, by the likelihood of normal noise.

    Iteratively reweighted least squares of a generalised linear model with gamma distribution and
    logarithmic link (P. McCullagh and J. A. Nelder, Generalized Linear Models, 1989).
    """
    known = counts > 0
    mean = sums[known] / counts[known]
    place = (wavelength_nm - wavelength_nm.mean()) / np.ptp(wavelength_nm)
    terms = np.stack([np.ones_like(place), place, place**2], axis=1)
    root = np.sqrt(counts[known])
    logarithm = np.full(len(mean), np.log(sums.sum() / counts.sum()))
    for _ in range(ITERATIONS):
        working = logarithm + np.clip(mean / np.exp(logarithm) - 1, -1, 1)
        factors = np.linalg.lstsq(terms[known] * root[:, np.newaxis], working * root, rcond=None)[0]
        logarithm = terms[known] @ factors
    last = np.flatnonzero(counts >= LAST_ROW_ENTRIES)[-1:]
    logarithm = terms @ factors
    if last.size:
        logarithm[last[0] + 1 :] = logarithm[last[0]]
    return np.asarray(np.exp(logarithm))


def _normalised(squares: FloatArray) -> FloatArray:
    """Return roots with a median of 1."""
    roots = np.sqrt(squares)
    return np.asarray(roots / np.median(roots))


def _ratio(above: FloatArray, below: NDArray[np.generic]) -> FloatArray:
    """Return the ratio, 0 where nothing was measured."""
    below = np.broadcast_to(below, above.shape)
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)  # type: ignore[operator]


def _clip_limit(values: FloatArray, used: BoolArray) -> FloatArray:
    """Return the size beyond which entries of each column are no noise, shape (m,)."""
    columns = np.where(used, np.abs(values), np.nan).reshape(-1, values.shape[-1])
    limit = np.full(columns.shape[1], np.inf)
    some = np.isfinite(columns).any(axis=0)
    limit[some] = CLIP_SIGMAS * SIGMA_OF_MEDIAN * np.nanmedian(columns[:, some], axis=0)
    return limit


def near_diagonal(matrix: ReradiationMatrix) -> BoolArray:
    """Return where output and input are one band or neighbours, shape (n, m)."""
    distance = np.abs(matrix.output_nm[:, np.newaxis] - matrix.input_nm)
    width = (matrix.output_width_nm[:, np.newaxis] + matrix.input_width_nm) / 2
    return np.asarray(distance < CLEAR_BANDS * width)


def _band_values(matrix: ReradiationMatrix) -> FloatArray:
    """Return the re-radiation as fractions per output band, shape (n, m)."""
    return matrix.reradiation * matrix.output_width_nm[:, np.newaxis]


def _same_bands(
    one: ReradiationMatrix | InstrumentNoise, other: ReradiationMatrix | InstrumentNoise
) -> bool:
    return all(
        len(a) == len(b) and np.allclose(a, b, rtol=0, atol=1e-6)
        for a, b in ((one.input_nm, other.input_nm), (one.output_nm, other.output_nm))
    )


#: Significance of an entry, and of those beside it: noise has stripes along the output, since one
#: dark reading serves a whole column, but never three columns side by side.
CLEAR_SIGMAS, BESIDE_SIGMAS = 5.0, 3.0


def reradiates(matrix: ReradiationMatrix) -> bool:
    """Return whether a surface re-radiates more than its noise.

    Parameters
    ----------
    matrix
        A matrix with σ of its re-radiation.

    Returns
    -------
    bool
        Whether some entry is 5 σ above zero, and both entries beside it, of the neighbouring input
        bands, are 3 σ above zero. Where one of these was not measured, as beside the only light
        that excites a sample, the neighbouring output bands stand for it.

    Raises
    ------
    DataError
        The re-radiation has no σ.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, reradiates, with_sigma
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> values = 0.5 * np.eye(31) + 1e-3 * np.random.default_rng(1).standard_normal((31, 31))
    >>> before = with_sigma(ReradiationMatrix.from_bands("", nm, nm, values))
    >>> values[12, 3:8] += 0.02
    >>> reradiates(before), reradiates(with_sigma(ReradiationMatrix.from_bands("", nm, nm, values)))
    (False, True)
    """
    sigma = required_sigma(matrix)
    used = matrix.is_stokes & ~near_diagonal(matrix)
    is_measured = np.isfinite(matrix.reradiation)
    used &= (sigma > 0) & is_measured
    pulls = np.divide(matrix.reradiation, sigma, out=np.zeros_like(sigma), where=used)
    # An entry on the edge has no neighbour that could agree.
    ends = np.pad(pulls, ((1, 1), (0, 0)))
    same_light = np.minimum(ends[:-2], ends[2:])
    beside = np.where(is_measured, pulls, np.nan)
    left, right = (
        np.where(np.isnan(near), same_light[:, 1:-1], near)
        for near in (beside[:, :-2], beside[:, 2:])
    )
    clear = (pulls[:, 1:-1] > CLEAR_SIGMAS) & (np.minimum(left, right) > BESIDE_SIGMAS)
    return bool(clear.any())
