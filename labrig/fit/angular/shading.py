"""Shading of a sphere: Lambert's law, the model of Oren and Nayar, and departures from both."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import optimize, stats

from labrig.fit.angular.dependence import detectable_sigmas, typical
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.results import LEVEL, DependenceTest, Measured, ShadingFit

#: Angles beyond which texture and penumbra count for more than the law: cosines of incidence, view.
LEAST_INCIDENCE, LEAST_VIEW = 0.35, 0.4
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
            "told; go on with labrig resume"
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
        used = (cos_incidence > LEAST_INCIDENCE) & (cos_view > LEAST_VIEW) & (image.radiance > 0)
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
    edges = np.linspace(LEAST_INCIDENCE, 1.0, _BINS + 1)
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
