"""Shading of a sphere: Lambert's law, the model of Oren and Nayar, and departures from both."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from scipy import optimize, stats

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.results import LEVEL, POWER, AngleMeans, DependenceTest, Measured, ShadingFit

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
            f"{len(angles)}: the scatter cannot be estimated; go on with labrig resume"
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


#: Angles beyond which texture and penumbra count for more than the law: cosines of incidence, view.
MIN_INCIDENCE, MIN_VIEW = 0.35, 0.4
#: Relative uncertainty of the light's distance.
DISTANCE_SIGMA = 0.02
#: Uncertainty of the outline's centre and radius that all views share, in radii, beside that of
#: finding it: of a fabric that is no perfect sphere.
OUTLINE_SIGMA = 0.003
#: Largest roughness in degrees that is tried.
MAX_ROUGHNESS_DEG = 60.0
#: Deviation from even light over that from Lambert's law below which a sample is flat.
EVEN = 0.5
_BINS = 12


@dataclass(frozen=True, eq=False)
class SphereImage:
    """One view of a sphere: k places on it.

    Attributes
    ----------
    normal
        Normals of the surface, shape (k, 3): x to the right, y down, z to the camera.
    radiance
        Signal at each place in any unit, shape (k,).
    errors
        Relative changes of the signal by one σ of m errors that all views share, such as that of
        the lens, shape (m, k).
    outline_covariance
        Covariance of x and y of the centre and of the radius of the outline from which the normals
        follow, in radii, as far as all views share their errors, shape (3, 3).
    """

    normal: FloatArray
    radiance: FloatArray
    errors: FloatArray
    outline_covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    def on_outline(self, x: float, y: float, radius: float) -> "SphereImage":
        """Return the image with an outline that is off by these fractions of its radius."""
        lateral = (self.normal[:, :2] - (x, y)) / (1 + radius)
        depth = np.sqrt(np.maximum(1 - (lateral**2).sum(axis=1), 0.0))
        return replace(self, normal=np.column_stack([lateral, depth]))


@dataclass(frozen=True)
class NearLight:
    """A small light near a sphere.

    Attributes
    ----------
    direction
        Direction from the sphere's centre, a vector of length 1: x to the right, y down, z to the
        camera.
    distance_radii
        Distance from the sphere's centre in radii.
    """

    direction: tuple[float, float, float]
    distance_radii: float


def oren_nayar(
    cos_incidence: FloatArray, cos_view: FloatArray, cos_azimuth: FloatArray, roughness_rad: float
) -> FloatArray:
    """Return the radiance of a rough diffuse surface, relative to a Lambertian one seen straight.

    The qualitative model of M. Oren and S. K. Nayar, *Generalization of Lambert's reflectance
    model*, SIGGRAPH 1994, eq. 30: cos θi (A + B max(0, cos Δφ) sin α tan β), α the larger and β
    the smaller of both angles.

    Parameters
    ----------
    cos_incidence, cos_view
        Cosines of the angles between normal and light, and normal and camera, of one shape.
    cos_azimuth
        Cosine of the angle between both planes, of that shape.
    roughness_rad
        Standard deviation of the facets' slopes in radians.

    Returns
    -------
    ndarray
        Radiance over that at normal incidence of a perfectly diffuse surface.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.angular import oren_nayar
    >>> cosine = np.array([1.0, 0.5])
    >>> oren_nayar(cosine, cosine, np.ones(2), 0.0).tolist()
    [1.0, 0.5]
    >>> oren_nayar(cosine, cosine, np.ones(2), 0.5).round(3).tolist()
    [0.784, 0.64]
    """
    variance = roughness_rad**2
    a = 1 - 0.5 * variance / (variance + 0.33)
    b = 0.45 * variance / (variance + 0.09)
    larger = np.minimum(cos_incidence, cos_view)
    smaller = np.maximum(cos_incidence, cos_view)
    sin_alpha = np.sqrt(np.maximum(1 - larger**2, 0.0))
    tan_beta = np.sqrt(np.maximum(1 - smaller**2, 0.0)) / np.maximum(smaller, 1e-9)
    lobe = np.maximum(cos_azimuth, 0.0) * sin_alpha * tan_beta
    return np.asarray(np.maximum(cos_incidence, 0.0) * (a + b * lobe))


def fit_shading(
    images: Sequence[SphereImage], light: NearLight, level: float = LEVEL
) -> ShadingFit:
    """Compare the shading of a sphere with Lambert's law and the model of Oren and Nayar.

    The light's fall-off, 1/r² from its place, is divided out. In each view, a scale and a small
    turn of the light are free; beside these the radiance over Lambert's law may change with the
    view's cosine and with that of incidence. The views, between which the sphere was put in anew,
    tell the scatter of both changes; what they share is added: distance of the light, centre and
    radius of the outline, and the errors of the images.

    Parameters
    ----------
    images
        Views of the sphere.
    light
        The light.
    level
        Level of each of both tests.

    Returns
    -------
    ShadingFit
        Shading by the angle of incidence, roughness, and both tests.

    Raises
    ------
    DataError
        There are fewer than three views, too little of the sphere is lit, or the light is as even
        as that of a flat sample.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.angular import NearLight, SphereImage, fit_shading
    >>> x, y = np.meshgrid(np.linspace(-0.9, 0.9, 30), np.linspace(-0.9, 0.9, 30))
    >>> on_sphere = x**2 + y**2 < 0.8
    >>> x, y = x[on_sphere], y[on_sphere]
    >>> normal = np.column_stack([x, y, np.sqrt(1 - x**2 - y**2)])
    >>> light = NearLight((-np.sqrt(0.5), 0.0, np.sqrt(0.5)), 1000.0)
    >>> rng = np.random.default_rng(1)
    >>> images = [
    ...     SphereImage(
    ...         normal,
    ...         np.maximum(normal @ light.direction, 0) * (1 + 0.02 * rng.standard_normal(len(x))),
    ...         np.zeros((0, len(x))),
    ...     )
    ...     for _ in range(4)
    ... ]
    >>> shading = fit_shading(images, light)
    >>> shading.by_view.finds_dependence, abs(shading.by_view.amplitude.value) < 0.05
    (False, True)
    """
    if len(images) < 3:
        raise DataError(
            f"expected three or more views of the sphere, got {len(images)}: the scatter cannot be "
            "estimated; go on with labrig resume"
        )
    views = [_View.of(image, light) for image in images]
    if all(view.is_even for view in views):
        raise DataError(
            "expected the shading of a sphere, got light as even as that of a flat sample; correct "
            "region and circle, or measure a flat sample with shape: yarn"
        )
    unknowns = np.array([_unknowns(view) for view in views])
    shared = _shared_errors(images[0], light)
    tests = [_test(unknowns[:, term], shared[:, term], level) for term in (0, 1)]
    roughness_rad = float(unknowns[:, 2].mean())
    by_scatter = unknowns[:, 2].var(ddof=1) / len(views)
    roughness_sigma = float(np.sqrt(by_scatter + (shared[:, 2] ** 2).sum()))
    return ShadingFit(
        **_binned(views, roughness_rad),
        roughness_deg=Measured(math.degrees(roughness_rad), math.degrees(roughness_sigma)),
        by_view=tests[0],
        by_incidence=tests[1],
    )


@dataclass(frozen=True, eq=False)
class _View:
    """The used places of one view; `excess` is radiance over Lambert's law, less 1."""

    cos_incidence: FloatArray
    cos_view: FloatArray
    cos_azimuth: FloatArray
    turns: FloatArray
    excess: FloatArray
    is_even: bool

    @classmethod
    def of(cls, image: SphereImage, light: NearLight) -> "_View":
        """Return the places that are lit and seen well."""
        cos_incidence, falloff = incidence(image.normal, light)
        cos_view = image.normal[:, 2]
        used = (cos_incidence > MIN_INCIDENCE) & (cos_view > MIN_VIEW) & (image.radiance > 0)
        if used.sum() < 50:
            raise DataError(
                f"expected a sphere of which much is lit, got {used.sum()} usable places; correct "
                "region, circle, or the direction of the light"
            )
        normal, seen, lit = image.normal[used], cos_view[used], cos_incidence[used]
        lambert = lit * falloff[used]
        ratio = image.radiance[used] / lambert
        # The scale by which the squared deviations from Lambert's law are least.
        scale = float((lit**2 * ratio).sum() / (lit**2).sum())
        sines = np.sqrt(np.maximum((1 - lit**2) * (1 - seen**2), 1e-12))
        return cls(
            cos_incidence=lit,
            cos_view=seen,
            cos_azimuth=np.clip((light.direction[2] - lit * seen) / sines, -1, 1),
            turns=normal @ _across(light.direction).T / lit[:, np.newaxis],
            excess=ratio / scale - 1,
            is_even=_is_even(lambert, image.radiance[used]),
        )

    def solved(self) -> FloatArray:
        """Return the change by view and by incidence from 0° to 90°, shape (2,)."""
        even = np.ones_like(self.excess)
        terms = np.column_stack([1 - self.cos_view, 1 - self.cos_incidence, even, self.turns])
        root = self.cos_incidence[:, np.newaxis]
        solution, *_ = np.linalg.lstsq(root * terms, root[:, 0] * self.excess, rcond=None)
        return np.asarray(solution[:2])

    def modelled(self, roughness_rad: float) -> FloatArray:
        """Return the model of Oren and Nayar over Lambert's law, in the measured scale."""
        model, weight = self._model(roughness_rad), self.cos_incidence**2
        scale = (weight * model * (1 + self.excess)).sum() / (weight * model**2).sum()
        return np.asarray(scale * model)

    def roughness_rad(self) -> float:
        """Return the roughness with which the model of Oren and Nayar deviates least."""

        def misfit(roughness_rad: float) -> float:
            solution, terms, root = self._scaled(self._model(roughness_rad))
            return float(((root * (1 + self.excess - terms @ solution)) ** 2).sum())

        found = optimize.minimize_scalar(
            misfit, bounds=(0.0, np.radians(MAX_ROUGHNESS_DEG)), method="bounded"
        )
        return float(found.x)

    def _model(self, roughness_rad: float) -> FloatArray:
        """Return the model over Lambert's law."""
        model = oren_nayar(self.cos_incidence, self.cos_view, self.cos_azimuth, roughness_rad)
        return np.asarray(model / self.cos_incidence)

    def _scaled(self, model: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return scale and turns of the light for a model, their terms, and root weights."""
        root = self.cos_incidence
        terms = np.column_stack([model, model[:, np.newaxis] * self.turns])
        weighted = root[:, np.newaxis] * terms
        solution, *_ = np.linalg.lstsq(weighted, root * (1 + self.excess), rcond=None)
        return np.asarray(solution, np.float64), terms, root


def incidence(normal: FloatArray, light: NearLight) -> tuple[FloatArray, FloatArray]:
    """Return the cosine of incidence and the fall-off at places on a sphere.

    Parameters
    ----------
    normal
        Normals of the surface, shape (k, 3).
    light
        The light.

    Returns
    -------
    tuple of ndarray
        Cosine of the angle of incidence, negative in the shade, and 1/r² relative to the sphere's
        centre, both of shape (k,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.angular import NearLight, incidence
    >>> cosine, falloff = incidence(np.array([[0.0, 0.0, 1.0]]), NearLight((0.0, 0.0, 1.0), 5.0))
    >>> cosine.tolist(), falloff.tolist()
    ([1.0], [1.5625])
    """
    to_light = light.distance_radii * np.asarray(light.direction) - normal
    distance = np.linalg.norm(to_light, axis=1)
    cosine = (to_light * normal).sum(axis=1) / distance
    return np.asarray(cosine), np.asarray((light.distance_radii / distance) ** 2)


def _across(direction: Sequence[float]) -> FloatArray:
    """Return two directions at right angles to a third one, shape (2, 3)."""
    along = np.asarray(direction)
    first = np.cross(along, (0.0, 1.0, 0.0) if abs(along[1]) < 0.9 else (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(along, first)])


def _is_even(lambert: FloatArray, radiance: FloatArray) -> bool:
    """Return whether the radiance is far closer to a constant than to Lambert's law of a sphere."""
    scale = float(lambert @ radiance / (lambert @ lambert))
    away = float(np.linalg.norm(radiance - scale * lambert))
    return float(np.linalg.norm(radiance - radiance.mean())) < EVEN * away


def _shared_errors(image: SphereImage, light: NearLight) -> FloatArray:
    """Return the change of coefficients and roughness by one σ of shared errors, shape (4 + m, 3).

    The last column is the roughness in radians.
    """
    farther = NearLight(light.direction, light.distance_radii * (1 + DISTANCE_SIGMA))
    covariance = image.outline_covariance + OUTLINE_SIGMA**2 * np.eye(3)
    off = np.linalg.cholesky(covariance).T
    changed = [
        _View.of(image, farther),
        *(_View.of(image.on_outline(*(float(part) for part in each)), light) for each in off),
        *(
            _View.of(replace(image, radiance=image.radiance * (1 + error)), light)
            for error in image.errors
        ),
    ]
    return np.array([_unknowns(view) for view in changed]) - _unknowns(_View.of(image, light))


def _unknowns(view: _View) -> FloatArray:
    return np.array([*view.solved(), view.roughness_rad()])


def _test(values: FloatArray, shared: FloatArray, level: float) -> DependenceTest:
    """Return the test of a coefficient of all views; `shared` are their common errors."""
    mean, views = float(values.mean()), len(values)
    by_scatter = float(values.var(ddof=1)) / views
    by_shared = float((shared**2).sum())
    sigma, dof = _combined(by_scatter, by_shared, views)
    half = float(stats.t.isf(level / 2, dof)) * sigma
    usual_sigma, usual_dof = _combined(typical(views - 1) ** 2 * by_scatter, by_shared, views)
    return DependenceTest(
        p=float(2 * stats.t.sf(abs(mean) / sigma, dof)),
        level=level,
        statistic=(mean / sigma) ** 2,
        dof=(1.0, dof),
        amplitude=Measured(mean, sigma),
        interval=(mean - half, mean + half),
        detectable=usual_sigma * detectable_sigmas(level, 1, usual_dof),
    )


def _combined(by_scatter: float, by_shared: float, views: int) -> tuple[float, float]:
    """Return σ by scatter and shared errors, and its degrees of freedom.

    They are Welch's and Satterthwaite's; those of the shared errors are infinite.
    """
    variance = by_scatter + by_shared
    dof = (views - 1) * (variance / max(by_scatter, 1e-300)) ** 2
    return float(np.sqrt(variance)), float(min(dof, 1e6))


def _binned(views: Sequence[_View], roughness_rad: float) -> dict[str, FloatArray]:
    """Return cosines, radiances, their scatter, and the model in bins of the cosine."""
    edges = np.linspace(MIN_INCIDENCE, 1.0, _BINS + 1)
    columns = []
    for view in views:
        bins = np.clip(np.digitize(view.cos_incidence, edges) - 1, 0, _BINS - 1)
        count = np.maximum(np.bincount(bins, minlength=_BINS), 1)
        model = view.modelled(roughness_rad) * view.cos_incidence
        measured = (1 + view.excess) * view.cos_incidence
        columns.append(
            [
                np.bincount(bins, weights, _BINS) / count
                for weights in (view.cos_incidence, measured, model)
            ]
        )
    bins_of_views = np.array(columns)
    filled = bins_of_views[:, :, (bins_of_views[:, 0] > 0).all(axis=0)]
    cosine, radiance, model = filled.mean(axis=0)
    scatter = filled[:, 1].std(axis=0, ddof=1) / np.sqrt(len(views))
    return {
        "cos_incidence": cosine,
        "radiance": radiance,
        "radiance_sigma": scatter,
        "oren_nayar": model,
    }
