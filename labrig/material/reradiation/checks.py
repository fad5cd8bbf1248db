"""Limits of what surfaces can do, and of what most of them do."""

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import Contradiction, ResultWarning
from labrig.material.reradiation.matrix import ReradiationMatrix

#: Radiance factors at 45°/0° are no energies: of 97 measured surfaces the brightest has 1.07.
UNUSUAL_FRACTION = 1.0
MAX_FRACTION = 1.1
#: Dark samples are found negative when the dark reading drifts.
LOWEST_REFLECTANCE = -0.02
SIGMAS = 3.0


def physical_warnings(matrix: ReradiationMatrix) -> tuple[ResultWarning, ...]:
    """Return warnings about a matrix that is unusual, and refuse one that cannot be.

    Parameters
    ----------
    matrix
        A matrix with or without σ; unknown σ count as 0. In a `relative` one nothing can be wrong.

    Returns
    -------
    tuple of ResultWarning
        A warning if more than all light of an input band comes back, reflected and re-radiated: as
        a radiance factor this can be, and the largest of the 97 surfaces measured for it is 1.07.

    Raises
    ------
    DataError
        The reflectance is below -0.02 - 3 σ, or more than 1.1 + 3 σ of some light comes back.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, physical_warnings
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> values = np.diag(np.full(31, 0.9))
    >>> values[20, 5] = 0.15
    >>> print(*physical_warnings(ReradiationMatrix.from_bands("paper", nm, nm, values)))
    1.050 of the light at 450 nm comes back from 'paper', more than from a perfect white
    """
    _refuse_negative(matrix)
    if matrix.unit == "relative":
        return ()
    fraction, sigma = matrix.total_fraction, _total_sigma(matrix)
    worst = int(np.argmax(fraction - SIGMAS * sigma))
    if fraction[worst] > MAX_FRACTION + SIGMAS * sigma[worst]:
        raise DataError(
            f"expected at most {MAX_FRACTION:g} + 3 σ of the light at "
            f"{matrix.input_nm[worst]:g} nm to come back from {matrix.name!r}, got "
            f"{fraction[worst]:.3f} ± {sigma[worst]:.3f}: look for a wrong scale or unit, such as "
            "percent"
        )
    brightest = int(np.argmax(fraction))
    if fraction[brightest] <= UNUSUAL_FRACTION:
        return ()
    return (
        Contradiction(
            "more-than-white",
            "{fraction:.3f} of the light at {input_nm:g} nm comes back from {material!r}, more "
            "than from a perfect white",
            fraction=fraction[brightest],
            input_nm=matrix.input_nm[brightest],
            material=matrix.name,
        ),
    )


def _refuse_negative(matrix: ReradiationMatrix) -> None:
    """Refuse a reflectance that no noise explains."""
    if np.isnan(matrix.reflectance).all():
        return
    sigma = _zeros_if_unknown(matrix.reflectance_sigma, matrix.reflectance)
    excess = matrix.reflectance - (LOWEST_REFLECTANCE - SIGMAS * sigma)
    lowest = int(np.nanargmin(excess))
    if excess[lowest] < 0:
        raise DataError(
            f"expected a reflectance of {matrix.name!r} of {LOWEST_REFLECTANCE:g} - 3 σ or more, "
            f"got {matrix.reflectance[lowest]:.4f} ± {sigma[lowest]:.4f} at "
            f"{matrix.output_nm[lowest]:g} nm: look for a wrong dark reading, or a row that is not "
            "the reflectance"
        )


def _total_sigma(matrix: ReradiationMatrix) -> FloatArray:
    """Return σ of the fraction of each input band's light that comes back, shape (m,)."""
    reradiated = _zeros_if_unknown(matrix.reradiated_fraction_sigma, matrix.input_nm)
    reflected = np.interp(
        matrix.input_nm,
        matrix.output_nm,
        _zeros_if_unknown(matrix.reflectance_sigma, matrix.reflectance),
        left=0.0,
        right=0.0,
    )
    return np.hypot(reradiated, reflected)


def _zeros_if_unknown(sigma: FloatArray | None, like: FloatArray) -> FloatArray:
    return np.zeros_like(like) if sigma is None else np.nan_to_num(sigma)
