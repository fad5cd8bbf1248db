"""All corrections of a measured matrix, in their order."""

from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.material.reradiation.noise import InstrumentNoise, with_sigma
from labrig.material.reradiation.offset import without_offset
from labrig.material.reradiation.spill import without_spill


def corrected(matrix: ReradiationMatrix, noise: InstrumentNoise | None = None) -> ReradiationMatrix:
    """Return a measured matrix with σ, without offsets of columns and without bandpass spill.

    Parameters
    ----------
    matrix
        A matrix as measured, with its anti-Stokes side.
    noise
        Noise of its instrument from `instrument_noise`; without it the matrix tells its own.

    Returns
    -------
    ReradiationMatrix
        What `with_sigma`, `without_offset` and `without_spill` make of it, one after the other.

    Raises
    ------
    DataError
        The matrix has too few anti-Stokes entries, or none with noise.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, corrected
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> noise = 0.001 * np.random.default_rng(1).standard_normal((31, 31))
    >>> tile = ReradiationMatrix.from_bands("tile", nm, nm, 0.5 * np.eye(31) + noise)
    >>> bool(corrected(tile).reradiated_fraction_sigma.max() > 0.001)
    True
    """
    return without_spill(without_offset(with_sigma(matrix, noise)))
