"""Effect of absorption in the depth of a sample on rates that were fitted as those of a surface.

Light of band b falls in a layer of optical density D_b to E_b 10^(−D_b z) at the fraction z of its
depth (Beer and Lambert). The layer charges and saturates at its surface first, and the glow is the
mean over its depth. A fit as a surface takes for k_e a mean over the depth, and for the glow of the
full sample less than all of it: by how much depends on D_b and on how far each charge went. Here
the same charges are fitted with the light of layers of rising density. Their rates over those of
the surface are what depth makes of k_e and Λ, and χ² is how far the charges speak for a density.

How light is absorbed from band to band is not known. Three courses are tried, between which most
layers lie: as k_e has it; as k_e has it beyond its peak and fully at all shorter waves, as by a
host; and alike in all bands, as by a grey binder. Charges tell the density better than its course,
so that the range is that of all courses at all densities left.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from labrig.fit.excitation.model_tests import LightErrors
from labrig.fit.excitation.parameters import RelativeSigmas
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.fit.nonlinear_least_squares import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.results import ChargingSeries, DensityBasis, FittedExcitation, LayerEffect

#: Depths of equal weight of Chebyshev's quadrature, as fractions of the whole: exact within 10⁻⁴ up
#: to an optical density of 2.
_OFFSETS = np.array([0.866246818107821, 0.422518653761112, 0.266635401516705])
DEPTHS: FloatArray = np.sort(np.concatenate([0.5 - _OFFSETS / 2, 0.5 + _OFFSETS / 2]))
#: Optical densities that are tried, as fractions of the largest, and largest that is one step.
FRACTIONS, ONE_STEP = (0.25, 0.5, 0.75, 1.0), 0.25
#: Rise of χ² over the best at which a density is left out: 3 σ, and a part of the fall of χ² by the
#: best layer, since its course of absorption from band to band is not the sample's.
LEFT_OUT, COURSE_ERROR = 9.0, 0.1
#: Rise of χ², in multiples of that, from which no larger density is tried.
FAR_OUT = 10.0
#: Number of densities in the range from 0 to the largest at which χ² is looked up.
LOOKED_UP = 81
#: Steps into which a transient of the lamp is divided.
PARTS = 4
#: Gains in χ² of a step at which a fit ends that only tells the absorption, and another one.
ROUGH_GAIN, MIN_GAIN = 0.1, 0.01
TOLERANCE = 1e-4
#: Numbers of evaluations after which a fit ends that is far out, and any other.
FAR_ITERATIONS, MAX_ITERATIONS = 10, 40


@dataclass(frozen=True)
class _Layer:
    """Rates by a layer of one density.

    Attributes
    ----------
    theta, chi2
        θ of the fit, and χ².
    k_e_per_s, reradiation
        k_e in 1/s, shape (N, B), and A/k_r, shape (N,).
    mean_light
        Mean light over the depth over that at the surface, shape (B,).
    """

    theta: FloatArray
    chi2: float
    k_e_per_s: FloatArray
    reradiation: FloatArray
    mean_light: FloatArray

    def absorption(self) -> FloatArray:
        """Return the absorption by excitation relative to that of the largest band, (B,)."""
        by_band: FloatArray = self.k_e_per_s.sum(axis=0)
        return by_band / max(float(by_band.max()), 1e-300)


def _grey(layer: _Layer) -> FloatArray:
    return np.ones(layer.k_e_per_s.shape[1])


def _exciting(layer: _Layer) -> FloatArray:
    return layer.absorption()


def _host(layer: _Layer) -> FloatArray:
    """Return the absorption that never rises with the wavelength."""
    return np.asarray(np.maximum.accumulate(layer.absorption()[::-1])[::-1])


#: Courses of absorption from band to band, given the rates of nearly the same layer.
COURSES = (_grey, _exciting, _host)


def layer_effect(
    series: Sequence[ChargingSeries],
    fit: FittedExcitation,
    uncertain: RelativeSigmas,
    largest_density: FloatArray,
    basis: DensityBasis,
) -> LayerEffect:
    """Return what depth may make of the rates of a fit as a surface.

    Parameters
    ----------
    series, fit, uncertain
        Charges, their fit, and the further sources of scatter that it was given.
    largest_density
        Largest optical density in each band, shape (B,).
    basis
        Where that is from.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.excitation import layer_effect
    >>> effect = layer_effect(series, fit, sigmas, np.full(8, 2.0), basis)  # doctest: +SKIP
    """
    layers = _Layers.of(series, fit, uncertain)
    surface = layers.surface
    largest = float(largest_density.max())
    fractions = FRACTIONS if largest > ONE_STEP else (1.0,)
    enlarged = max(1.0, fit.reduced_chi2)
    density: list[float] = [0.0]
    courses = [[surface] for _ in COURSES]
    far_out = FAR_OUT * LEFT_OUT * enlarged
    best = surface.chi2
    for tried in largest * np.array(fractions):
        for course, absorption in zip(courses, COURSES, strict=True):
            layer = course[-1]
            # Absorption follows k_e, which follows from absorption.
            for gain in (MIN_GAIN,) if absorption is _grey else (ROUGH_GAIN, MIN_GAIN):
                by_band = np.minimum(tried * absorption(layer), largest_density)
                layer = layers.fitted(by_band, layer, gain, best + far_out)
            course.append(layer)
        density.append(float(tried))
        lowest = min(course[-1].chi2 for course in courses)
        best = min(best, lowest)
        if lowest > best + far_out:
            break
    at = np.linspace(0.0, density[-1], LOOKED_UP)
    rise = np.min(
        [
            CubicSpline(density, [one.chi2 - surface.chi2 for one in course])(at)
            for course in courses
        ],
        axis=0,
    )
    best = float(rise.min())
    left = np.flatnonzero(rise <= best + LEFT_OUT * enlarged - COURSE_ERROR * min(best, 0.0))
    low, high = at[left[[0, -1]]]
    inside = at[left[0] : left[-1] + 1]
    k_e = np.concatenate([_ratios(density, [one.k_e_per_s for one in c], inside) for c in courses])
    whole = np.concatenate(
        [_ratios(density, [one.reradiation for one in c], inside) for c in courses]
    )
    # A band of which no excitation is seen has no ratio: those of the others are its range.
    seen = np.array([state.seen for state in fit.states])
    ends = np.stack([k_e.min(axis=0), k_e.max(axis=0)])
    if seen.any():
        ends[0, ~seen], ends[1, ~seen] = ends[0, seen].min(), ends[1, seen].max()
    return LayerEffect(
        optical_density=(float(low), float(high)),
        basis=basis,
        k_e_factor=ends,
        reradiation_factor=np.stack([whole.min(axis=0), whole.max(axis=0)]),
    )


def _ratios(density: Sequence[float], values: Sequence[FloatArray], at: FloatArray) -> FloatArray:
    """Return values over those of the surface at some densities; 1 where those are 0."""
    table = np.array(values)
    is_there = table[0] > 0
    ratios = np.where(is_there, table / np.where(is_there, table[0], 1.0), 1.0)
    logarithms = np.log(np.maximum(ratios, np.finfo(float).tiny))
    return np.asarray(np.exp(PchipInterpolator(density, logarithms)(at)))


@dataclass(frozen=True, eq=False)
class _Layers:
    """Charges in the brightest channel, with the errors of the light as found, and their fit."""

    series: Sequence[ChargingSeries]
    uncertain: RelativeSigmas
    order: float | None
    problem: ExcitationProblem
    surface: _Layer

    @classmethod
    def of(
        cls, series: Sequence[ChargingSeries], fit: FittedExcitation, uncertain: RelativeSigmas
    ) -> "_Layers":
        channel = int(np.argmax(fit.channel_weights))
        own = slice(channel, channel + 1)
        seen = [
            replace(
                one,
                values=one.values[..., own],
                sigma=one.sigma[..., own],
                frame_light=None if one.frame_light is None else one.frame_light[..., own],
                rise=one.rise.in_parts(PARTS),
                fade=one.fade.in_parts(PARTS),
            )
            for one in series
        ]
        seen, scatter = LightErrors(1.0, fit.site_sizes).applied(seen, uncertain)
        scatter = replace(
            scatter,
            lamp=fit.lamp_sigma,
            largest_factor=0.0,
            offset=scatter.offset[own],
            common_mode=scatter.common_mode[own],
        )
        k_r, amplitude, each_order = np.array(
            [(state.k_r_per_s, state.amplitude, state.kinetic_order) for state in fit.states]
        ).T
        order = None if fit.are_orders_fitted else float(each_order[0])
        problem = ExcitationProblem(seen, len(k_r), 0, scatter, order)
        theta = problem.parameters.as_stated(k_r, amplitude, fit.k_e(), np.ones(1), each_order)
        problem.rewhiten(theta)
        surface = _minimum(problem, theta, np.ones(problem.parameters.bands))
        return cls(seen, scatter, order, problem, surface)

    def fitted(
        self, density: FloatArray, near: _Layer, least_gain: float, far_chi2: float
    ) -> _Layer:
        """Return the fit of a layer of a density in each band, shape (B,), from a near one.

        It ends at a step of a gain in χ² below `least_gain`, or soon if χ² stays above `far_chi2`.
        """
        arriving = 10.0 ** -np.outer(DEPTHS, density)
        series = [replace(one, arriving=arriving) for one in self.series]
        states = self.problem.parameters.states
        problem = ExcitationProblem(series, states, 0, self.uncertain, self.order)
        problem.whiten_as(self.problem)
        # Weak light excites in proportion to its mean over the depth.
        theta, mean = near.theta.copy(), arriving.mean(axis=0)
        growth = problem.parameters.columns.growth
        theta[growth] *= np.tile(near.mean_light / mean, states)
        return _minimum(problem, theta, mean, least_gain, far_chi2)


def _minimum(
    problem: ExcitationProblem,
    theta: FloatArray,
    mean_light: FloatArray,
    least_gain: float = MIN_GAIN,
    far_chi2: float = np.inf,
) -> _Layer:
    lower, upper = problem.parameters.bounds()
    for most in (FAR_ITERATIONS, MAX_ITERATIONS):
        solution = least_squares(
            problem.residuals,
            theta,
            lower=lower,
            upper=upper,
            max_iterations=most,
            tolerance=TOLERANCE,
            least_gain=least_gain,
        )
        theta = solution.parameters
        if solution.iterations < most or solution.chi2 > far_chi2:
            break
    rates = problem.parameters.unpack(solution.parameters)
    # The states of a fit are those of its θ by falling rate.
    falling = np.argsort(-rates.k_r_per_s, kind="stable")
    return _Layer(
        theta,
        solution.chi2,
        rates.k_e_per_s[falling],
        (rates.amplitude / rates.k_r_per_s)[falling],
        mean_light,
    )
