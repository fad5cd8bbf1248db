"""A saturation run, from its frames to its result."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from labrig.analyse.clean import cleaned
from labrig.analyse.part import Part
from labrig.analyse.saturation.charge_level import charge_level
from labrig.analyse.saturation.rate_comparison import compare_rates, curve, flicker_dof
from labrig.analyse.series_fit import fit_series
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import intact_frames, timing_warnings
from labrig.errors import DataError
from labrig.protocols.saturation import WeakerLight
from labrig.record import FrameRole, RunRecord, charges_s
from labrig.reduce import reduce_patches
from labrig.results import (
    LIGHTS,
    ChargeLevel,
    Curve,
    FloatArray,
    Measured,
    PatchSaturation,
    RatesTest,
    SaturationResult,
    Series,
)
from labrig.written_numbers import plus_minus


def analyse(part: Part) -> SaturationResult:
    """Compare plateaus, levels where there were two lights, and rates shared and not.

    Raises
    ------
    DataError
        Fewer than two decays under the full light, or frames are damaged.
    FitError
        The decays do not allow a fit.
    """
    protocol, run, camera = part.protocol, part.run, part.inputs.camera
    frames, stray = cleaned(intact_frames(run, part.choices), part.inputs.blank)
    insist_on_this_camera(camera, run, run.frames(FrameRole.DECAY))
    regions = part.choices.patches(protocol)
    series = reduce_patches(frames.decay, regions, frames.dark, camera=camera)
    lasted_s, weaker = _charges_s(run), protocol.weaker
    patches = {name: _patch(one, lasted_s, part) for name, one in series.items()}
    return SaturationResult(
        patches=patches,
        weaker_light=weaker and Measured(weaker.share, weaker.share * weaker.share_sigma),
        warnings=(
            *timing_warnings(run),
            *stray,
            *(
                f"{name}: {line}" if len(patches) > 1 else line
                for name, patch in patches.items()
                for line in _warnings(patch)
            ),
        ),
    )


def _charges_s(run: RunRecord) -> dict[str, float]:
    """How long the lamp really shone before the decay of each unit."""
    units = [
        unit
        for unit, attempt in run.completed().items()
        if any(frame.purpose == FrameRole.DECAY for frame in attempt.frames)
    ]
    return dict(zip(units, charges_s(run), strict=True))


def _patch(series: Series, lasted_s: Mapping[str, float], part: Part) -> PatchSaturation:
    decays = {one.unit[0]: one for one in series.by_unit()}
    units = list(decays)
    light = tuple(unit.partition("-")[0] for unit in units)
    full, weaker = ([row for row, one in enumerate(light) if one == kind] for kind in LIGHTS)
    if len(full) < 2:
        raise DataError(
            "expected two or more complete decays under the full light, got "
            f"{len(full)}; go on with labrig resume"
        )
    asked = part.choices.states or (
        None if part.protocol.states == "auto" else part.protocol.states
    )
    longest = decays[units[full[-1]]]
    fit = fit_series(longest, asked, fixed_rates_per_s=part.choices.fixed_rates_per_s)
    curves = {unit: curve(one, fit) for unit, one in decays.items()}
    start_per_s = [state.k_r_per_s for state in fit.states]
    rates = compare_rates(list(curves.values()), start_per_s, flicker_dof(fit))
    charge_s = np.array([lasted_s[unit] for unit in units])
    levels: Iterable[ChargeLevel] = ()
    if part.protocol.weaker is not None and weaker:
        levels = _levels(rates, charge_s, weaker[-1], full[-1], part.protocol.weaker)
    begin, end = _growths(*(curves[units[row]] for row in full[-2:]))
    return PatchSaturation(fit, light, charge_s, curves, rates, begin, end, tuple(levels))


def _levels(
    rates: RatesTest, charge_s: FloatArray, dim: int, bright: int, weaker: WeakerLight
) -> Iterator[ChargeLevel]:
    """Of every state, by the decays after the longest charges under the weaker and full light."""
    for state, k_per_s in enumerate(rates.shared_per_s):
        a, b = rates.amplitude[[dim, bright], state]
        of_a, of_b = rates.amplitude_sigma[[dim, bright], state]
        if b <= 0:
            yield ChargeLevel(0.0, 1.0)
            continue
        ratio = max(a / b, 1e-6)
        sigma = float(np.hypot(of_a / b, a / b * of_b / b))
        both_s = (charge_s[dim], charge_s[bright])
        yield charge_level(ratio, sigma, weaker.share, weaker.share_sigma, float(k_per_s), both_s)


def _growths(before: Curve, last: Curve) -> Iterator[Measured]:
    """Of the glow from one decay to the next, as a share, at the begin and the end of both."""
    count = min(len(before.value), len(last.value))
    ratio = last.value[:count] / before.value[:count]
    sigma = np.abs(ratio) * np.hypot(
        last.sigma[:count] / last.value[:count], before.sigma[:count] / before.value[:count]
    )
    part = max(count // 4, 1)
    for rows in (slice(None, part), slice(-part, None)):
        weight = 1 / sigma[rows] ** 2
        mean = float(weight @ ratio[rows] / weight.sum())
        yield Measured(mean - 1, float(1 / np.sqrt(weight.sum())))


def _warnings(patch: PatchSaturation) -> Iterator[str]:
    if patch.in_time == "not saturated":
        yield (
            "the glow still grows at the longest charge: charge for longer before decays whose "
            "amplitudes are to be compared"
        )
    if any(one.verdict == "no" for one in patch.levels):
        levels = ", ".join(plus_minus(one.r, one.sigma) for one in patch.levels)
        yield (
            f"r(0) = 1 does not hold after the longest charge: r(0) = {levels}; Λ from the decay "
            "alone would be too small by that factor, in each state by another: fit excitation "
            "and decay jointly"
        )
    if patch.rates.differ:
        yield (
            f"the rates depend on the charge (p = {patch.rates.p_value:.2g}): the decay is no sum "
            f"of {patch.fit.n_states} exponentials of fixed rates, as power laws are none; what "
            "was found holds for the charge it was measured at"
        )
