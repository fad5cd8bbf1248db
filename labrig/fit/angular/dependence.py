"""Test of a dependence on angle against the scatter of repeated placings."""

from functools import cache

import numpy as np
from scipy import optimize, stats

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.results import LEVEL, POWER, AngleMeans, DependenceTest, Measured

#: Iterations of the scatter that, with the camera's noise, explains the residuals.
_ITERATIONS = 50


def fit_dependence(
    angle_deg: FloatArray,
    signal: FloatArray,
    sigma: FloatArray,
    level: float = LEVEL,
    shared: FloatArray | None = None,
) -> AngleMeans:
    """Test whether a signal depends on an angle, and tell how small a dependence would be found.

    The logarithms of views at the same angle scatter by the noise of the camera, which is known,
    and by how the sample was put in, which the scatter tells. Means that are free for each angle
    are compared with a common one by Fisher's F (N. R. Draper, H. Smith, *Applied Regression
    Analysis*, 3rd ed., 1998, section 9.1), beside a drift proportional to the number of the view.
    An error that all views share adds to the covariance of the means. The test holds its level
    with scatter that is not normal if all angles have about as many views. The amplitude is that
    of the straight line through the views; power is that of F against such lines.

    Parameters
    ----------
    angle_deg
        Angle of each view in degrees, in the order in which they were taken, shape (n,).
    signal
        Signal of each view in any unit, above 0, shape (n,).
    sigma
        Standard uncertainty of the signals by the camera's noise, shape (n,).
    level
        Probability of a dependence found where there is none.
    shared
        Relative change of each view by one σ of an error that all of them share, shape (n,), for
        example of the reflected light that was subtracted; None without any.

    Returns
    -------
    AngleMeans
        Mean relative to that over all angles, scatter, and the test.

    Raises
    ------
    DataError
        There are fewer than two angles, fewer than two views to tell the scatter, or a signal that
        is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.angular import fit_dependence
    >>> rng = np.random.default_rng(1)
    >>> angle_deg = np.tile([30.0, 60.0, 90.0], 6)
    >>> signal = 100 * (1 + 0.01 * rng.standard_normal(18))
    >>> means = fit_dependence(angle_deg, signal, np.full(18, 0.1))
    >>> means.test.finds_dependence, f"{means.test.detectable:.1%}"
    (False, '2.5%')
    """
    angle_deg, signal = np.asarray(angle_deg, np.float64), np.asarray(signal, np.float64)
    if not (signal > 0).all():
        raise DataError("expected signals above 0 in all views, got some that are not")
    angles, place = np.unique(angle_deg, return_inverse=True)
    order = np.linspace(-0.5, 0.5, len(signal))
    free = np.column_stack([np.eye(len(angles))[place], order])
    dof = len(signal) - int(np.linalg.matrix_rank(free))
    if len(angles) < 2 or dof < 2:
        raise DataError(
            f"expected several views at each of two or more angles, got {len(signal)} views at "
            f"{len(angles)}: the scatter cannot be told; go on with labrig resume"
        )
    value, noise = np.log(signal), np.asarray(sigma, np.float64) / signal
    scatter = _scatter(free, value, noise, dof)
    weight = 1 / np.maximum(scatter**2 + noise**2, np.finfo(float).tiny)
    common = np.zeros_like(value) if shared is None else np.asarray(shared, np.float64)
    means, covariance, chi2 = _solved(free, value, weight)
    variance = max(chi2 / dof, np.finfo(float).tiny)
    common_means, *_ = _solved(free, common, weight)
    covariance = variance * covariance + np.outer(common_means, common_means)
    between = len(angles) - 1
    relative = np.eye(len(angles)) - 1 / len(angles)
    log_mean = relative @ means[:-1]
    mean_covariance = relative @ covariance[:-1, :-1] @ relative.T
    statistic = float(log_mean @ np.linalg.pinv(mean_covariance, hermitian=True) @ log_mean)
    statistic /= between
    sloped = np.column_stack([np.ones_like(order), order, _from_middle(angle_deg)])
    slope, slope_covariance, _ = _solved(sloped, value, weight)
    common_slope, *_ = _solved(sloped, common, weight)
    slope_sigma = float(np.sqrt(variance * slope_covariance[2, 2] + common_slope[2] ** 2))
    half = float(stats.t.isf(level / 2, dof)) * slope_sigma
    test = DependenceTest(
        p=float(stats.f.sf(statistic, between, dof)),
        level=level,
        statistic=statistic,
        dof=(float(between), float(dof)),
        amplitude=Measured(float(slope[2]), slope_sigma),
        interval=(float(slope[2]) - half, float(slope[2]) + half),
        detectable=slope_sigma * typical(dof) * detectable_sigmas(level, between, dof),
    )
    mean_sigma = np.sqrt(np.diag(mean_covariance))
    drift_sigma = float(np.sqrt(covariance[-1, -1]))
    drift = float(np.exp(means[-1]))
    ratio = np.exp(value - means[:-1].mean() - means[-1] * order)
    return AngleMeans(
        angle_deg=angles,
        mean=np.exp(log_mean),
        mean_sigma=np.exp(log_mean) * mean_sigma,
        band=float(stats.t.isf(0.025, dof)) * mean_sigma,
        scatter=Measured(scatter, float(np.sqrt(np.mean(1 / weight) / (2 * dof)))),
        drift=Measured(drift - 1, drift * drift_sigma),
        ratio=ratio,
        residual=value - free @ means,
        test=test,
    )


@cache
def detectable_sigmas(level: float, dof: float, scatter_dof: float, power: float = POWER) -> float:
    """Return the size in σ of an effect that an F test finds with a given power.

    The effect is one of `dof` that the test looks at; F then has Fisher's noncentral distribution
    with the square of that size as its noncentrality.

    Parameters
    ----------
    level
        Level of the test.
    dof, scatter_dof
        Degrees of freedom of numerator and denominator.
    power
        Probability with which the effect is found.

    Returns
    -------
    float
        Size of the effect over its standard uncertainty.

    Examples
    --------
    >>> from labrig.fit.angular import detectable_sigmas
    >>> print(f"{detectable_sigmas(0.05, 1, 1e6):.2f} σ")
    3.24 σ
    """
    limit = stats.f.isf(level, dof, scatter_dof)

    def lacking(size: float) -> float:
        return float(stats.ncf.sf(limit, dof, scatter_dof, size**2)) - power

    largest = 10.0
    while lacking(largest) < 0:
        largest *= 2
    return float(optimize.brentq(lacking, 0.1, largest, xtol=1e-4))


def typical(dof: float) -> float:
    """Return the true σ over the median of those that so many degrees of freedom tell.

    Without it, what is stated as detectable with 90 % power would be found a little less often.

    Parameters
    ----------
    dof
        Degrees of freedom of the measured σ.

    Returns
    -------
    float
        Factor of a measured σ, above 1.

    Examples
    --------
    >>> from labrig.fit.angular import typical
    >>> print(f"{typical(3):.3f} {typical(19):.3f}")
    1.126 1.018
    """
    return float(np.sqrt(dof / stats.chi2.median(dof)))


def _from_middle(angle_deg: FloatArray) -> FloatArray:
    """Return the angles from −1/2 to 1/2."""
    least, largest = angle_deg.min(), angle_deg.max()
    return np.asarray((angle_deg - (least + largest) / 2) / (largest - least))


def _solved(
    design: FloatArray, value: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the solution of weighted least squares, its covariance, and χ²."""
    covariance = np.asarray(np.linalg.pinv(design.T @ (weight[:, np.newaxis] * design)), float)
    solution = covariance @ (design.T @ (weight * value))
    residual = value - design @ solution
    return np.asarray(solution), covariance, float(weight @ residual**2)


def _scatter(design: FloatArray, value: FloatArray, noise: FloatArray, dof: int) -> float:
    """Return the scatter that makes χ² equal to its degrees of freedom, or 0.

    After R. C. Paule and J. Mandel, J. Res. NBS 87, 377 (1982).
    """

    def excess(scatter: float) -> float:
        return _solved(design, value, 1 / (scatter**2 + noise**2))[2] - dof

    largest = 2 * float(np.std(value)) + 1e-9
    least = 1e-6 * largest
    if excess(least) <= 0:
        return 0.0
    while excess(largest) > 0:
        largest *= 2
    return float(optimize.brentq(excess, least, largest, maxiter=_ITERATIONS))
