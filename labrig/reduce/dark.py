"""Level of the sensor in the dark over exposure time."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from labrig.foundation.errors import DataError
from labrig.reduce.plane_noise import Floats

#: Relative difference within which two exposure times are the same, by the rounding of cameras.
SAME_EXPOSURE = 0.02


@dataclass(frozen=True, eq=False)
class DarkModel:
    """Dark level b + d·T of each channel of one patch, in DN above black.

    Parameters
    ----------
    base
        Offset b in DN, shape (C,).
    rate_per_s
        Dark current d in DN/s, shape (C,).
    covariance
        Covariance of b and d, shape (C, 2, 2).
    only_exposure_s
        Exposure time in seconds if all dark frames had the same: the model holds there only (and d
        is 0); None if they had several.
    """

    base: Floats
    rate_per_s: Floats
    covariance: Floats
    only_exposure_s: float | None

    def dark_level(self, exposure_s: float) -> tuple[Floats, Floats]:
        """Return the dark level and its standard uncertainty in DN, each of shape (C,).

        Raises
        ------
        DataError
            All dark frames had another exposure time.
        """
        only = self.only_exposure_s
        if only is not None and not same_exposure(only, exposure_s):
            raise DataError(
                f"expected dark frames of {exposure_s:g} s or of several exposures, got only "
                f"{only:g} s; take dark frames at the shortest and the longest exposure"
            )
        terms = np.array([1.0, exposure_s])
        return self.base + self.rate_per_s * exposure_s, np.sqrt(terms @ self.covariance @ terms)

    def current(self, exposure_s: float) -> Floats:
        """Return the signal of the dark current during an exposure in DN, shape (C,).

        It is an upper limit if all dark frames had one exposure time: they cannot separate it from
        an error of the black level.
        """
        if self.only_exposure_s is not None:
            return self.base
        return self.rate_per_s * exposure_s


def fit_dark(exposure_s: Floats, level: Floats, sigma: Floats) -> DarkModel:
    """Fit the dark level b + d·T of each channel by weighted least squares.

    Where the frames scatter by more than `sigma` (the camera's black level drifts), the covariance
    is raised to the observed scatter, and by what its few degrees of freedom leave open: 68 % of
    Student's t distribution are within 1.84 σ with one of them (JCGM 100:2008, G.3).

    Parameters
    ----------
    exposure_s
        Exposure time T of each dark frame in seconds, shape (n,).
    level
        Mean dark levels in DN above black, shape (n, C).
    sigma
        Standard uncertainties of the levels in DN, shape (n, C).

    Returns
    -------
    DarkModel
        Black offset b in DN and dark current d in DN/s of each channel, with their covariance.

    Raises
    ------
    DataError
        There are no dark frames.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import fit_dark
    >>> exposure_s = np.array([0.1, 1.0, 10.0])
    >>> level = np.array([[2.01], [2.10], [3.00]])  # DN, one channel
    >>> model = fit_dark(exposure_s, level, sigma=np.full((3, 1), 0.01))
    >>> dark_dn, sigma_dn = model.dark_level(5.0)
    >>> print(f"{dark_dn[0]:.2f} ± {sigma_dn[0]:.3f} DN")
    2.50 ± 0.006 DN
    """
    if len(exposure_s) == 0:
        raise DataError("expected dark frames, got none; take some before charging")
    single_exposure = same_exposure(float(exposure_s.min()), float(exposure_s.max()))
    design = np.ones((len(exposure_s), 1))
    if not single_exposure:
        design = np.stack([np.ones_like(exposure_s), exposure_s], axis=1)
    channels = level.shape[1]
    coefficients, covariance = np.zeros((channels, 2)), np.zeros((channels, 2, 2))
    terms = design.shape[1]
    dof = len(exposure_s) - terms
    for channel in range(channels):
        weighted = design / sigma[:, channel, np.newaxis]
        inverse = np.linalg.inv(weighted.T @ weighted)
        coefficients[channel, :terms] = (
            inverse @ weighted.T @ (level[:, channel] / sigma[:, channel])
        )
        misfit = (level[:, channel] - design @ coefficients[channel, :terms]) / sigma[:, channel]
        scatter = float(misfit @ misfit) / dof if dof else 1.0
        if scatter > 1:
            scatter *= float(stdtrit(dof, ndtr(1.0))) ** 2
        covariance[channel, :terms, :terms] = inverse * max(scatter, 1.0)
    return DarkModel(
        base=coefficients[:, 0],
        rate_per_s=coefficients[:, 1],
        covariance=covariance,
        only_exposure_s=float(exposure_s.mean()) if single_exposure else None,
    )


def same_exposure(first_s: float, second_s: float) -> bool:
    """Return whether two exposure times agree within the rounding of cameras."""
    return abs(first_s - second_s) <= SAME_EXPOSURE * max(first_s, second_s)
