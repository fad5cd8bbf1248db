"""The lamp's light on the sample: its errors, its course across a place, its transients.

Every place behind the filter has an irradiance of its own. The lamp's transients in every band are
the measured ones, or those of typical halogen lamps.

A charge counts with one brightness. At its end the sample has forgotten light from long before, at
the rate κ + k_r at which it approaches its level, while the housing still warms: a long charge is
as of the warm lamp at its end, not of the mean. κ is not known yet; k_r alone, of the decay, leaves
a part of that.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from labrig.calibration import Change, FadeFile, IrradianceFile
from labrig.foundation.arrays import FloatArray
from labrig.material import phi1
from labrig.protocols.excitation.result import LightScatter, PatchCharging
from labrig.results import Charge, ChargingSeries, FittedDecay, FittedExcitation, Transient

#: Relative scatter of the light on single places: bands are calibrated place by place, and their
#: flanks scatter, which smooth errors alone cannot describe; and error of a filter's wavelengths in
#: nm beyond its calibration's. First values of a fit that finds the size of both.
SITE_SIGMA, WAVELENGTH_SIGMA_NM = 0.03, 1.0
#: Relative scatter of a lamp's brightness from charge to charge, likewise.
LAMP_SIGMA = 0.01
#: Factor of these values up to which sizes are tried.
MAX_FACTOR = 3.0
#: Kinds of error whose size the fit finds, in the order of its sizes; and of known size.
WAVELENGTHS, SITES, KNOWN = 0, 1, -1
#: Number of smooth modes along the filter: errors are uncorrelated over some 40 nm.
SMOOTH_MODES = 9
#: Largest relative σ of the light, within which its logarithm is linear.
WORST = 1.0
#: Least light as a fraction of the most, for its logarithm.
MIN_LIGHT = 1e-6
#: Wavelengths in nm and times in seconds in which a halogen lamp falls to 1/e (from literature),
#: and time after which it is dark (Nalbach et al., section 4.6).
USUAL_NM = (419.0, 650.0)
USUAL_1_E_S = (0.031, 0.051)
DARK_S = 0.32
STEPS = 64


def site_modes(irradiance: IrradianceFile) -> FloatArray:
    """Return the error modes of each place's irradiance, smooth along the filter or independent.

    Camera curves, the filter's wavelengths, its widths and leakage have errors that are smooth
    along the filter. The first are the same in all bands, the second move light from band to band,
    the others change it at a band's edges and far from it.

    Returns
    -------
    ndarray
        Modes of the logarithm, shape (M, P, B).
    """
    through, sigma = np.array(irradiance.through), np.array(irradiance.through_sigma)
    light_sigma = _relative_sigma(irradiance)[:, None]
    position = np.array(irradiance.position)
    knots = np.linspace(position[0], position[-1], SMOOTH_MODES)
    fraction = np.clip(1 - np.abs(position - knots[:, None]) / (knots[1] - knots[0]), 0.0, None)
    smooth = np.sin(np.pi / 2 * fraction)[..., None]
    nm = np.ptp(irradiance.bands_nm) * (position - position[0]) / np.ptp(position)
    slope_per_nm = np.gradient(np.log(_positive_light(through)), nm, axis=0)
    shape_sigma = np.sqrt(
        np.clip((sigma / _positive_light(through)) ** 2 - light_sigma**2, 0.0, WORST**2)
    )
    bands = np.ones(through.shape[1])
    independent = SITE_SIGMA * np.eye(len(position))[..., None]
    return np.concatenate(
        [
            smooth * light_sigma * bands,
            smooth * WAVELENGTH_SIGMA_NM * slope_per_nm,
            smooth * shape_sigma,
            independent * bands,
        ]
    )


def mode_kinds(irradiance: IrradianceFile) -> NDArray[np.intp]:
    """Return the kind of each of the `site_modes`, shape (M,)."""
    smooth = np.repeat([KNOWN, WAVELENGTHS, KNOWN], SMOOTH_MODES)
    return np.append(smooth, np.full(len(irradiance.position), SITES))


def light_scatter(fit: FittedExcitation) -> LightScatter:
    """Return the scatter of the light that a fit found; of selected lights, the lamp's alone."""
    if not fit.site_sizes:
        return LightScatter(fit.lamp_sigma, None, None)
    return LightScatter(
        lamp=fit.lamp_sigma,
        wavelength_nm=WAVELENGTH_SIGMA_NM * fit.site_sizes[WAVELENGTHS],
        sites=SITE_SIGMA * fit.site_sizes[SITES],
    )


def across_sites(irradiance: IrradianceFile) -> FloatArray:
    """Return the irradiance at two places within each site relative to its mean, shape (2, P, B).

    The two places are Gauss's: with them a mean over a site is exact up to third order.
    """
    position, through = np.array(irradiance.position), _positive_light(np.array(irradiance.through))
    course = PchipInterpolator(position, np.log(through), axis=0)
    offset = 1 / len(position) / 2 / np.sqrt(3)
    log_light, slope = course(position), course(position, 1)
    # At the ends there is nothing to look up beyond the last place's middle.
    pair: FloatArray = np.exp(np.stack([log_light - slope * offset, log_light + slope * offset]))
    mean: FloatArray = pair.mean(axis=0)
    return pair / mean


def band_sigma(irradiance: IrradianceFile) -> tuple[float, ...]:
    """Return the relative σ of the lamp's own light in each band, which is common to all places.

    The other errors of the irradiance are those of `site_modes`.
    """
    direct = np.array(irradiance.direct_sigma) / np.maximum(np.array(irradiance.direct), 1e-300)
    return tuple(direct.tolist())


def scale_sigma(irradiance: IrradianceFile) -> float:
    """Return the relative σ of the light on all places over that of the lamp by itself.

    It includes the uncertainty of the best-known place, which all places have in common: the
    camera's response to a narrow band relative to the lamp's whole light.
    """
    return float(np.hypot(irradiance.scale_sigma, _relative_sigma(irradiance).min()))


def lamp_transients(fade: FadeFile | None, bands_nm: FloatArray) -> tuple[Transient, Transient]:
    """Return turn-on and turn-off transient; without a file, those of typical halogen lamps.

    A rise that was not measured is taken as the inverted fade: a filament heats about as fast as it
    cools.
    """
    if fade is None:
        usual_fade = _typical_fade(bands_nm)
        return _inverted(usual_fade), usual_fade
    measured_fade = _measured_transient(fade, fade.fade, bands_nm, end=0.0)
    if fade.rise is None:
        return _inverted(measured_fade), measured_fade
    return _measured_transient(fade, fade.rise, bands_nm, end=1.0), measured_fade


def _relative_sigma(irradiance: IrradianceFile) -> FloatArray:
    """Return the relative σ of all light on each place, shape (P,)."""
    through, sigma = np.array(irradiance.through), np.array(irradiance.through_sigma)
    relative: FloatArray = np.sqrt((sigma**2).sum(axis=1)) / np.maximum(through.sum(axis=1), 1e-300)
    return relative


def _positive_light(light: FloatArray) -> FloatArray:
    positive: FloatArray = np.maximum(light, MIN_LIGHT * light.max())
    return positive


def _measured_transient(
    file: FadeFile, change: Change, bands_nm: FloatArray, end: float
) -> Transient:
    """Return the transient in steps short enough, until the lamp has reached its `end`."""
    times_s, fraction = file.in_bands(change, bands_nm)
    fine_s = np.linspace(0.0, times_s[-1], STEPS + 1)
    fine = np.column_stack([np.interp(fine_s, times_s, column) for column in fraction.T])
    fine[-1] = end
    return Transient.sampled(fine_s, fine)


def _typical_fade(bands_nm: FloatArray) -> Transient:
    middles_nm = (bands_nm[1:] + bands_nm[:-1]) / 2
    tau_s = np.interp(middles_nm, USUAL_NM, USUAL_1_E_S)
    times_s = np.linspace(0.0, DARK_S, STEPS + 1)
    fraction = np.exp(-times_s[:, None] / tau_s)
    fraction[-1] = 0.0
    return Transient.sampled(times_s, fraction)


def _inverted(fade: Transient) -> Transient:
    return Transient(fade.duration_s, 1 - fade.fraction)


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
