"""Brightness of a lamp that warms during a charge, as the sample remembers it.

A charge counts with one brightness. At its end the sample has forgotten light from long before, at
the rate κ + k_r at which it approaches its level, while the housing still warms: a long charge is
as of the warm lamp at its end, not of the mean. κ is not known yet; k_r alone, of the decay, leaves
a part of that.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from labrig.material import phi1
from labrig.protocols.excitation.result import PatchCharging
from labrig.results import Charge, ChargingSeries, FittedDecay


def remembered_warmth(
    charging: PatchCharging, decay: FittedDecay, deficit: float, time_constant_s: float
) -> PatchCharging:
    """Return a patch's charging with the lamp's deficit as the sample remembers it.

    Parameters
    ----------
    charging
        Charging of a patch, with the mean deficit of every charge.
    decay
        Decay of the patch, whose mean rate is that at which the glow forgets.
    deficit, time_constant_s
        Relative deficit of a cold lamp, and time constant in s with which its housing warms.
    """
    rate, glow = np.array([(state.k_r_per_s, state.amplitude) for state in decay.states]).T
    k_r_per_s = float(rate @ glow / glow.sum())

    def of(series: ChargingSeries) -> ChargingSeries:
        charges = _remembered(series.charges, deficit, time_constant_s, k_r_per_s)
        earlier = series.earlier
        if earlier is not None:
            before = _remembered(earlier.charges, deficit, time_constant_s, k_r_per_s)
            earlier = replace(earlier, charges=before)
        return replace(series, charges=charges, earlier=earlier)

    return replace(charging, through=of(charging.through), direct=of(charging.direct))


def scatter_by_warmth(charging: PatchCharging, deficit_sigma: float) -> float:
    """Return the scatter of the lamp from charge to charge that its warm-up leaves open.

    Light that lacks by one exponential of the housing's time has an error of one size at all
    charges; an error of its course differs among them, by as much as their deficits do.

    Parameters
    ----------
    charging
        Charging of a patch.
    deficit_sigma
        σ of the relative deficit of a cold lamp.
    """
    charges = (*charging.through.charges, *charging.direct.charges)
    return deficit_sigma * float(np.std([charge.cold_deficit for charge in charges]))


def _remembered(
    charges: Iterable[Charge], deficit: float, time_constant_s: float, k_r_per_s: float
) -> tuple[Charge, ...]:
    lit = []
    for charge in charges:
        cold = charge.cold_deficit * weighted_over_mean(
            charge.off_s - charge.on_s, time_constant_s, k_r_per_s
        )
        lit.append(replace(charge, brightness=1 - deficit * cold, cold_deficit=cold))
    return tuple(lit)


def weighted_over_mean(charge_s: float, time_constant_s: float, k_r_per_s: float) -> float:
    """Return the mean of exp(−t/τ) over a charge by the weight exp(−k (T − t)) over the plain one.

    Parameters
    ----------
    charge_s, time_constant_s, k_r_per_s
        T and τ in s, and k in 1/s, all > 0.
    """
    warmings, forgettings = charge_s / time_constant_s, charge_s * k_r_per_s
    weighted, mean_weight, mean = phi1(np.array([forgettings - warmings, forgettings, warmings]))
    return float(np.exp(-warmings) * weighted / (mean_weight * mean))
