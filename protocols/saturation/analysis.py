"""Analysis of a saturation run, from its frames to its result.

The level of charge of a state follows from how much less it glows after a weaker light. Under a
constant light r(t) = κ/s (1 − e^(−s t)), s = κ + k. A light weaker by the factor q gives q κ: where
r is small the glow falls by q, where it is near 1 hardly at all. Amplitudes are only compared, so
that neither Λ nor the camera's scale enters.

Decays after several charges have shared rates or individual ones. All are one channel wide here:
the channels of a frame are combined with the weights of the brightest decay's fit, which lowers the
noise. Amplitudes are linear, so only the rates are searched for (variable projection).

A state of kinetic order b decays as (1 + u R t)^(−1/u), u = (b − 1)/b, whatever its charge, with
the rate R = b k r(0)^(b − 1) at lamp off; its light there is Λ k r(0)ᵇ, so that R grows with the
power u of the light. First order, and any mixture of exponentials in fixed proportion, has the same
R after every charge. The two exponents, of the shape and of the shift, are measured apart.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc

from labrig.analyse.frame_times import timing_warnings
from labrig.analyse.frames import intact_frames, require_calibrated_camera, without_stray_light
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.series_fit import fit_series
from labrig.calibration import BLANK_KIND, CAMERA_KIND
from labrig.fit import EPSILON, LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, FitError
from labrig.foundation.number_format import plus_minus
from labrig.foundation.result_warning import Misfit, ResultWarning, Undetermined
from labrig.material import DECAY_LAWS, exponential_means, exponential_means_and_slopes
from labrig.protocols.saturation.options import SaturationOptions
from labrig.protocols.saturation.protocol import Light, WeakerLight
from labrig.protocols.saturation.result import (
    Concentration,
    Curve,
    OrderTest,
    PatchSaturation,
    RatesTest,
    SaturationResult,
)
from labrig.record import FrameRole, RunRecord, charge_durations_s
from labrig.reduce import reduce_patches
from labrig.results import FittedDecay, Measured, Series

BECQUEREL = DECAY_LAWS["becquerel"]
#: Largest exponent of the shape: that of b = 4.
MAX_SHAPE = 0.75
START_SHAPE = 0.3
#: Parameters of a decay: logarithms of light and rate at lamp off, and offset over its σ.
OWN = 3


def compare_levels(curves: Sequence[Curve]) -> OrderTest | None:
    """Fit decays after several charges by one shape, each with its own light and rate.

    Parameters
    ----------
    curves
        The decays, each with more than two frames.

    Returns
    -------
    OrderTest or None
        Rates over the light at lamp off; None if they cannot be fitted.
    """
    if len(curves) < 2 or any(not np.any(curve.value > 0) for curve in curves):
        return None
    theta = [START_SHAPE]
    for curve in curves:
        brightest = float(curve.value.max())
        lasting = curve.t_s[curve.value > brightest / np.e]
        rate = 1 / max(float(lasting[-1]), float(curve.t_s[0]), 1e-9)
        theta += [np.log(brightest), np.log(rate), 0.0]
    low = np.array([0.0, *[-np.inf] * OWN * len(curves)])
    high = np.array([MAX_SHAPE, *[np.inf] * OWN * len(curves)])

    def residuals(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        parts = [
            _residuals(curve, float(theta[0]), theta[1 + OWN * row : 1 + OWN * (row + 1)])
            for row, curve in enumerate(curves)
        ]
        jacobian = np.zeros((sum(len(off) for off, _ in parts), len(theta)))
        begin = 0
        for row, (off, slopes) in enumerate(parts):
            rows = slice(begin, begin + len(off))
            jacobian[rows, 0] = slopes[:, 0]
            jacobian[rows, 1 + OWN * row : 1 + OWN * (row + 1)] = slopes[:, 1:]
            begin += len(off)
        return np.concatenate([off for off, _ in parts]), jacobian

    try:
        fit = least_squares(residuals, theta, lower=low, upper=high, max_iterations=500)
    except FitError:
        return None
    return _test(fit, len(curves)) if fit.converged and fit.dof > 0 else None


def _residuals(curve: Curve, shape: float, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return model − value over σ, the offset's prior last, and slopes by shape and own (n, 4)."""
    amplitude, rate = np.exp(own[:2]).tolist()
    means, slopes = BECQUEREL.means(rate, shape, curve.t_s, curve.exposure_s)
    offset = np.full(len(means), curve.offset_sigma)
    off = (amplitude * means + own[2] * offset - curve.value) / curve.sigma
    columns = [amplitude * slopes[:, 1], amplitude * means, amplitude * slopes[:, 0], offset]
    jacobian = np.column_stack(columns) / curve.sigma[:, np.newaxis]
    return np.append(off, own[2]), np.vstack([jacobian, [0.0, 0.0, 0.0, 1.0]])


def _test(fit: LeastSquaresFit, decays: int) -> OrderTest | None:
    """Return the exponents of shape and shift, their σ enlarged where the shape does not fit."""
    covariance = fit.covariance * max(fit.reduced_chi2, 1.0)
    rates = 2 + OWN * np.arange(decays)
    log_light, log_rate = fit.parameters[rates - 1], fit.parameters[rates]
    of_rates = covariance[np.ix_(rates, rates)]
    if not np.isfinite(of_rates).all():
        return None
    design = np.column_stack([np.ones(decays), log_light - log_light.mean()])
    weighted = np.linalg.solve(of_rates, design)
    line = np.linalg.pinv(design.T @ weighted) @ weighted.T
    shift = float(line[1] @ log_rate)
    # What a light is wrong by moves its rate along the line.
    by_parameter = np.zeros((2, len(fit.parameters)))
    by_parameter[0, 0] = 1.0
    by_parameter[1, rates] = line[1]
    by_parameter[1, rates - 1] = -shift * line[1]
    both = by_parameter @ covariance @ by_parameter.T
    difference = np.array([1.0, -1.0])
    shape_sigma, shift_sigma = np.sqrt(np.diag(both)).tolist()
    return OrderTest(
        light=np.exp(log_light),
        rate_per_s=np.exp(log_rate),
        rate_per_s_sigma=np.exp(log_rate) * np.sqrt(np.diag(of_rates)),
        shape=Measured(float(fit.parameters[0]), shape_sigma),
        shift=Measured(shift, shift_sigma),
        difference_sigma=float(np.sqrt(difference @ both @ difference)),
        chi2=fit.chi2,
        dof=fit.dof,
    )


#: Range of lights κ in multiples of the rate of re-radiation: r∞ of 1e-4 to 0.9999.
FAINTEST, STRONGEST = 1e-4, 1e4
#: Relative step of the derivatives.
STEP = 1e-3
#: σ of the logarithm of a rate from which a decay does not determine it: a factor of 20.
UNDETERMINED = 3.0


def charged(kappa_per_s: float, k_per_s: float, charge_s: float) -> float:
    """Return the level r after a charge from the dark under constant light (exact)."""
    total_rate = kappa_per_s + k_per_s
    return float(kappa_per_s / total_rate * -np.expm1(-total_rate * charge_s))


def charge_level(
    ratio: float,
    ratio_sigma: float,
    fraction: float,
    fraction_sigma: float,
    k_per_s: float,
    charge_durations_s: tuple[float, float],
) -> Concentration:
    """Return the level of a state under the full light.

    Parameters
    ----------
    ratio, ratio_sigma
        Amplitude after the weaker light over that after the full one, and its standard uncertainty.
    fraction, fraction_sigma
        Weaker light over the full one, q, and its relative standard uncertainty.
    k_per_s
        Rate of the state in 1/s.
    charge_durations_s
        Duration of the charges under the weaker and under the full light in seconds.
    """
    r = _level(ratio, fraction, k_per_s, charge_durations_s)
    by_ratio = (_level(ratio * (1 + STEP), fraction, k_per_s, charge_durations_s) - r) / STEP
    by_fraction = (_level(ratio, fraction * (1 + STEP), k_per_s, charge_durations_s) - r) / STEP
    sigma = np.hypot(by_ratio * ratio_sigma / ratio, by_fraction * fraction_sigma)
    # At an end of the range, where nothing changes any more, the σ is that just inside.
    least = ratio_sigma / ratio * fraction / (1 - fraction)
    return Concentration(r, float(max(sigma, least)))


def _level(
    ratio: float, fraction: float, k_per_s: float, charge_durations_s: tuple[float, float]
) -> float:
    def excess(log_kappa: float) -> float:
        kappa = float(np.exp(log_kappa))
        weaker, full = charge_durations_s
        return charged(fraction * kappa, k_per_s, weaker) / charged(kappa, k_per_s, full) - ratio

    low, high = np.log(FAINTEST * k_per_s), np.log(STRONGEST * k_per_s)
    if excess(low) >= 0:
        return 0.0
    if excess(high) <= 0:
        return 1.0
    return charged(float(np.exp(brentq(excess, low, high))), k_per_s, charge_durations_s[1])


def curve(series: Series, fit: FittedDecay) -> Curve:
    """Combine the channels of a series with the weights of `fit`, flicker in its σ."""
    rows = series.usable
    weights = np.array(fit.channel_weights)
    values, sigmas = series.values[rows], series.sigma[rows]
    weight_sum = (weights / sigmas**2) @ weights
    value = (values / sigmas**2) @ weights / weight_sum
    sigma = np.hypot(1 / np.sqrt(weight_sum), fit.flicker * np.maximum(value, 0.0))
    dark = np.nan_to_num(series.dark_sigma)
    fractions = np.mean(weights / sigmas**2, axis=0) / np.mean(weight_sum)
    return Curve(series.t_s[rows], series.exposure_s[rows], value, sigma, float(fractions @ dark))


def flicker_dof(fit: FittedDecay) -> float:
    """Return the degrees of freedom from which a fit estimated its flicker; infinite if given."""
    if not fit.flicker_sigma > 0:
        return np.inf
    return max(0.5 * (fit.flicker / fit.flicker_sigma) ** 2, 1.0)


def compare_rates(
    curves: Sequence[Curve], start_per_s: Sequence[float], noise_dof: float = np.inf
) -> RatesTest:
    """Fit all decays with shared rates, then each with its own, with the same number of states.

    Parameters
    ----------
    curves
        The decays.
    start_per_s
        Initial rates in 1/s, one for each state.
    noise_dof
        Degrees of freedom from which the curves' σ was estimated; infinite if it is known.

    Raises
    ------
    FitError
        There are too few frames, or some decay lacks these states.
    """
    start = np.log(np.asarray(start_per_s, dtype=np.float64))
    states = len(start)
    dof = sum(len(decay.t_s) for decay in curves) - 2 * states * len(curves)
    if dof < 1 or min(len(decay.t_s) for decay in curves) <= 2 * states:
        raise FitError(
            f"expected more than {2 * states} frames of each decay for {states} state(s); record "
            "more, or ask for fewer states"
        )
    shared, shared_chi2, _ = _fit(curves, start)
    own_fits = [_fit([decay], shared) for decay in curves]
    own_chi2 = sum(chi2 for _, chi2, _ in own_fits)
    amplitudes = [_amplitudes(decay, np.exp(shared)) for decay in curves]
    added = states * (len(curves) - 1)
    gain = max(shared_chi2 - own_chi2, 0.0) / added
    # A smaller scatter than σ does not lower it: σ may be a little too large, never too small.
    scatter = max(own_chi2 / dof, 1.0)
    falling = np.argsort(-shared)
    own = [(log_rates, sigma) for log_rates, _, sigma in own_fits]
    return RatesTest(
        shared_per_s=np.exp(shared)[falling],
        own_per_s=np.array([_rates(*each)[0][falling] for each in own]),
        own_sigma_per_s=np.array([_rates(*each)[1][falling] for each in own]),
        amplitude=np.array([value[falling] for value, _ in amplitudes]),
        amplitude_sigma=np.array([sigma[falling] for _, sigma in amplitudes]),
        residuals=tuple(-_misfit(decay, np.exp(shared)[falling])[0][:-1] for decay in curves),
        chi2_shared=shared_chi2,
        chi2_own=own_chi2,
        dof_own=dof,
        noise_dof=noise_dof,
        p_value=float(fdtrc(added, dof, gain / scatter)),
    )


def _rates(log_rates: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rates (s,) and their σ from their logarithms, NaN and infinity if not known.

    Where a decay lacks a state, the logarithm of its rate runs off.
    """
    is_determined = sigma < UNDETERMINED
    rates = np.exp(np.where(is_determined, log_rates, 0.0))
    spread = rates * np.where(is_determined, sigma, 0.0)
    return np.where(is_determined, rates, np.nan), np.where(is_determined, spread, np.inf)


def _fit(curves: Sequence[Curve], start: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Return the logarithms of the rates (s,), χ² and the σ of these logarithms."""

    def residuals(log_rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        misfits, slopes = zip(*(_misfit(decay, np.exp(log_rates)) for decay in curves), strict=True)
        return np.concatenate(misfits), np.concatenate(slopes)

    result = least_squares(residuals, start)
    return result.parameters, result.chi2, result.sigma


def _misfit(decay: Curve, rates_per_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return model − value with the best amplitudes, whitened, and its slopes by the log rates.

    The shapes are (n + 1,) and (n + 1, s). The slopes are Kaufman's (BIT 15, 1975), without the
    part that other amplitudes explain.
    """
    means, by_log_rate = exponential_means_and_slopes(rates_per_s, decay.t_s, decay.exposure_s)
    design, target = _design(decay, means), _target(decay)
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    slopes = np.zeros((len(target), len(rates_per_s)))
    slopes[:-1] = by_log_rate * solution[:-1] / decay.sigma[:, np.newaxis]
    basis = np.linalg.qr(design)[0]
    return np.asarray(design @ solution - target), slopes - basis @ (basis.T @ slopes)


def _amplitudes(decay: Curve, rates_per_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    design = _design(decay, exponential_means(rates_per_s, decay.t_s, decay.exposure_s))
    covariance = np.linalg.pinv(design.T @ design, rcond=1e3 * EPSILON)
    solution = covariance @ design.T @ _target(decay)
    return solution[:-1], np.sqrt(np.diag(covariance))[:-1]


def _design(decay: Curve, shapes: FloatArray) -> FloatArray:
    """Return the whitened design (n + 1, s + 1) of shapes (n, s), with the offset's prior last."""
    offset = np.full((len(decay.t_s), 1), decay.offset_sigma)
    rows = np.hstack([shapes, offset]) / decay.sigma[:, np.newaxis]
    prior = np.zeros((1, rows.shape[1]))
    prior[0, -1] = 1.0
    return np.vstack([rows, prior])


def _target(decay: Curve) -> FloatArray:
    """Return the whitened values and the offset's prior, shape (n + 1,)."""
    return np.append(decay.value / decay.sigma, 0.0)


def analyse(context: AnalysisContext) -> SaturationResult:
    """Compare plateaus, levels of charge under two lights, and shared with individual rates.

    Raises
    ------
    DataError
        There are fewer than two decays under the full light, or frames are damaged.
    FitError
        The decays do not allow a fit.
    """
    protocol, run, camera = context.protocol, context.run, context.inputs[CAMERA_KIND]
    frames, stray = without_stray_light(
        intact_frames(run, context.overrides), context.inputs[BLANK_KIND]
    )
    require_calibrated_camera(camera, run, run.frames(FrameRole.DECAY))
    regions = context.overrides.patches(protocol)
    series = reduce_patches(frames.decay, regions, frames.dark, camera=camera)
    charge_s, weaker = _charges_s(run), protocol.weaker
    patches = {
        name: _patch_saturation(patch_series, charge_s, context)
        for name, patch_series in series.items()
    }
    return SaturationResult(
        patches=patches,
        weaker_light=weaker and Measured(weaker.fraction, weaker.fraction * weaker.fraction_sigma),
        warnings=(
            *timing_warnings(run),
            *stray,
            *(
                warning.about(name if len(patches) > 1 else "")
                for name, patch in patches.items()
                for warning in _warnings(patch)
            ),
        ),
    )


def _charges_s(run: RunRecord) -> dict[str, float]:
    """Return the measured duration of the charge before the decay of each unit in seconds."""
    units = [
        unit
        for unit, attempt in run.completed().items()
        if any(frame.role == FrameRole.DECAY for frame in attempt.frames)
    ]
    return dict(zip(units, charge_durations_s(run), strict=True))


def _patch_saturation(
    series: Series, unit_charge_s: Mapping[str, float], context: AnalysisContext
) -> PatchSaturation:
    decays = {decay.unit[0]: decay for decay in series.by_unit()}
    units = list(decays)
    light = tuple(Light.of(unit).value for unit in units)
    full, weaker = (
        [row for row, decay_light in enumerate(light) if decay_light == kind] for kind in Light
    )
    if len(full) < 2:
        raise DataError(
            "expected two or more complete decays under the full light, got "
            f"{len(full)}; go on with labrig resume"
        )
    options = context.options(SaturationOptions)
    states = options.states or (
        None if context.protocol.states == "auto" else context.protocol.states
    )
    longest = decays[units[full[-1]]]
    fit = fit_series(longest, states, fixed_rates_per_s=options.rate)
    curves = {unit: curve(decay, fit) for unit, decay in decays.items()}
    start_per_s = [state.k_r_per_s for state in fit.states]
    rates = compare_rates(list(curves.values()), start_per_s, flicker_dof(fit))
    charge_s = np.array([unit_charge_s[unit] for unit in units])
    levels: Iterable[Concentration] = ()
    if context.protocol.weaker is not None and weaker:
        levels = _levels(rates, charge_s, weaker[-1], full[-1], context.protocol.weaker)
    before, last = (curves[units[row]] for row in full[-2:])
    begin, end = (growth(before, last, fit, at_end=at_end) for at_end in (False, True))
    order = compare_levels(list(curves.values()))
    return PatchSaturation(fit, light, charge_s, curves, rates, begin, end, tuple(levels), order)


def _levels(
    rates: RatesTest, charge_s: FloatArray, dim: int, bright: int, weaker: WeakerLight
) -> Iterator[Concentration]:
    """Iterate over the level of every state, after the longest charges under both lights."""
    for state, k_per_s in enumerate(rates.shared_per_s):
        a, b = rates.amplitude[[dim, bright], state]
        a_sigma, b_sigma = rates.amplitude_sigma[[dim, bright], state]
        if b <= 0:
            yield Concentration(0.0, 1.0)
            continue
        ratio = max(a / b, 1e-6)
        sigma = float(np.hypot(a_sigma / b, a / b * b_sigma / b))
        durations_s = (charge_s[dim], charge_s[bright])
        yield charge_level(
            ratio, sigma, weaker.fraction, weaker.fraction_sigma, float(k_per_s), durations_s
        )


def growth(before: Curve, last: Curve, fit: FittedDecay, *, at_end: bool) -> Measured:
    """Return the relative growth of the glow between two decays, at their start or end.

    The frames of two decays are at other times. Each decay is held against a fit, and a parabola in
    time common to both takes up by what the fit is wrong there, the noise it followed included.

    Parameters
    ----------
    before, last
        The decays; a quarter of the frames of each is begin or end.
    fit
        Fit of a decay of nearly the same shape.
    at_end
        Whether the end is meant.

    Returns
    -------
    Measured
        Growth as a fraction.
    """
    scales, parts = [], []
    for is_last, curve in enumerate((before, last)):
        count = max(len(curve.value) // 4, 2)
        rows = slice(-count, None) if at_end else slice(None, count)
        t_s, value, sigma = curve.t_s[rows], curve.value[rows], curve.sigma[rows]
        model, _ = fit.signal(t_s, curve.exposure_s[rows], with_offset=True)
        scale = float((model / sigma**2) @ value / ((model / sigma**2) @ model))
        scales.append(scale)
        model = scale * model
        parts.append((np.full_like(t_s, is_last), t_s, model / sigma, (value - model) / sigma))
    grown, t_s, over_sigma, off = (np.concatenate(each) for each in zip(*parts, strict=True))
    x = (t_s - t_s.mean()) / np.ptp(t_s)
    design = np.column_stack([grown, np.ones_like(x), x, x**2]) * over_sigma[:, np.newaxis]
    covariance = np.linalg.pinv(design.T @ design)
    more = float((covariance @ design.T @ off)[0])
    ratio = scales[1] / scales[0]
    return Measured(ratio * (1 + more) - 1, float(abs(ratio) * np.sqrt(covariance[0, 0])))


def _warnings(patch: PatchSaturation) -> Iterator[ResultWarning]:
    if patch.time_saturation == "not saturated":
        yield Undetermined(
            "not-saturated",
            "the glow still grows at the longest charge: charge for longer before decays whose "
            "amplitudes are to be compared",
        )
    if any(level.assessment == "no" for level in patch.levels):
        yield Misfit(
            "charge-incomplete",
            "r(0) = 1 does not hold after the longest charge: r(0) = {levels}; Λ from the decay "
            "alone would be too small by that factor, in each state by another: fit excitation "
            "and decay jointly",
            levels=tuple(plus_minus(level.r, level.sigma) for level in patch.levels),
        )
    if patch.rates.differ:
        yield Misfit(
            "rates-depend-on-charge",
            "the rates depend on the charge (p = {p_value:.2g}): the decay is no sum of {states} "
            "exponentials of fixed rates, as power laws are none; the rates hold for the charge "
            "they were measured at",
            p_value=patch.rates.p_value,
            states=patch.fit.n_states,
        )
    if patch.is_of_general_order:
        assert patch.order is not None
        yield Misfit(
            "general-order",
            "the glow falls as that of a state of kinetic order {order}, the more slowly the less "
            "it was charged: rates of exponentials hold for one charge only; excitation determines "
            "the order, too",
            order=patch.order.order,
        )
    if patch.is_of_no_law:
        assert patch.order is not None
        yield Misfit(
            "no-kinetic-order",
            "neither first order nor a kinetic order describes how the glow falls after different "
            "charges (exponents {by_charge.plus_minus} by the charge, {by_shape.plus_minus} by the "
            "shape of the decays): rates hold for the charge they were measured at; measure the "
            "decay after the charge that matters, and give excitation two states of free order "
            "(--states 2 --order free)",
            by_charge=patch.order.shift,
            by_shape=patch.order.shape,
        )
