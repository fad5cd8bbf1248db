"""Dependence of light on the angle, as fits determine it."""

from dataclasses import dataclass

from labrig.foundation.arrays import FloatArray
from labrig.results.measured import Measured

#: Level of the tests: the probability of a dependence found where there is none.
LEVEL = 0.05
#: Power at which the smallest dependence is stated that would have been found.
POWER = 0.9


@dataclass(frozen=True)
class DependenceTest:
    """Test of one quantity against no dependence.

    Attributes
    ----------
    p
        Probability of a statistic as large as this one where there is no dependence.
    level
        Level of this test, `LEVEL` divided by the number of tests that share the answer.
    statistic
        Fisher's F.
    dof
        Degrees of freedom of F: of the dependence, and of the measured scatter.
    amplitude
        Dependence as a fraction: the linear change from the least to the largest angle, or the
        change from 0° to 90° of a sphere's surface.
    interval
        Confidence interval of the amplitude at 1 − `level`.
    detectable
        Smallest amplitude that would have been found with `POWER`.
    """

    p: float
    level: float
    statistic: float
    dof: tuple[float, float]
    amplitude: Measured
    interval: tuple[float, float]
    detectable: float

    @property
    def finds_dependence(self) -> bool:
        """True if the dependence is significant at the test's level."""
        return self.p < self.level


@dataclass(frozen=True, eq=False)
class AngleMeans:
    """Means of n views at k angles, relative to the mean over the angles, and their test.

    Attributes
    ----------
    angle_deg
        Angles in degrees, rising, shape (k,).
    mean, mean_sigma
        Mean at each angle and its standard uncertainty by the measured scatter, shape (k,).
    band
        Half width at each angle of the interval about 1 in which the mean lies with 95 %
        probability if there is no dependence, shape (k,).
    scatter
        Standard deviation of the repositionings, beyond the camera's noise, as a fraction.
    drift
        Change from the first view to the last one, as a fraction.
    ratio, residual
        Views relative to the mean over the angles, drift divided out, and what remains of them
        beside the means, shape (n,).
    test
        Test of the means.
    """

    angle_deg: FloatArray
    mean: FloatArray
    mean_sigma: FloatArray
    band: FloatArray
    scatter: Measured
    drift: Measured
    ratio: FloatArray
    residual: FloatArray
    test: DependenceTest


@dataclass(frozen=True, eq=False)
class ShadingFit:
    """Shading of a sphere in several views, against Lambert's law.

    Attributes
    ----------
    cos_incidence
        Cosine of the angle of incidence, mean of each of b bins, rising, shape (b,).
    radiance, radiance_sigma
        Radiance over irradiance at normal incidence, fall-off divided out, scaled to Lambert's law,
        and its scatter between views, shape (b,).
    oren_nayar
        Model of Oren and Nayar at the fitted roughness in the same bins, shape (b,).
    roughness_deg
        Standard deviation of the facets' slopes in degrees by that model.
    by_view
        Test of a dependence on the angle between normal and camera: amplitude of a term
        1 − cos θ.
    by_incidence
        Test of a dependence of the radiance over the irradiance on the angle of incidence.
    """

    cos_incidence: FloatArray
    radiance: FloatArray
    radiance_sigma: FloatArray
    oren_nayar: FloatArray
    roughness_deg: Measured
    by_view: DependenceTest
    by_incidence: DependenceTest
