"""Charging series of even sites, from a run's frames: every charge and the photographs after it.

A slice of the strip consists of whole pixels, and some of a colour filter array's colours lie in
every other column only: a channel's mean belongs to a place up to a pixel beside the site's middle,
and to another width. Along the filter the glow may change by a factor of two from site to site, so
that this matters wherever sites are a few pixels wide. The glow of a channel is taken for a cubic
spline whose means over the channel's pixels are those measured; its means over the sites are linear
in them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.interpolate import CubicSpline

from labrig.analyse.frame_times import timed, untimed
from labrig.analyse.frames import require_calibrated_camera
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import Slices, StripPatch, slice_strip, strip_regions, tilt_offset
from labrig.calibration import BLANK_KIND, CAMERA_KIND, FADE_KIND, IrradianceFile, Warming
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import ResultWarning
from labrig.protocols.excitation.analysis.charge_intervals import (
    ChargeFrames,
    ChargeInterval,
    charge_frames,
)
from labrig.protocols.excitation.analysis.lamp_light import (
    KNOWN,
    across_sites,
    lamp_transients,
    mode_kinds,
    site_modes,
)
from labrig.protocols.excitation.analysis.selected_light import selected_light
from labrig.protocols.excitation.result import PatchCharging
from labrig.protocols.steps.exciting_lights import ExcitingLights
from labrig.record import FrameRole
from labrig.reduce import SensorLayout, reduce_patches, sensor_layout
from labrig.results import (
    Charge,
    ChargingSeries,
    EarlierCharges,
    FittedExcitation,
    Series,
    Transient,
)


def evenness(values: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return about how bright every place is after the same light, 1 on average, shape (P,).

    What earlier charges have left at the places counts as their brightness here; a fit tells the
    two apart.

    Parameters
    ----------
    values, sigma
        Photographs after charges by the lamp itself, shape (n, P, C).

    Raises
    ------
    DataError
        Some place does not glow, or is clipped.
    """
    weight = np.where(np.isfinite(values) & (sigma > 0), 1 / np.square(sigma), 0.0)
    is_known = weight.min(axis=1, keepdims=True) > 0
    expected = np.where(
        is_known, np.nanmean(np.where(is_known, values, 0.0), axis=1, keepdims=True), 0.0
    )
    weight = np.where(is_known, weight, 0.0)
    total = (weight * expected**2).sum(axis=(0, 2))
    if not (total > 0).all():
        raise DataError(
            "expected a glow all along the filter's place after charges by the lamp itself, got "
            "none somewhere, or it is clipped; check where the sample and the filter lie"
        )
    signal = (weight * expected * np.nan_to_num(values)).sum(axis=(0, 2)) / total
    return np.asarray(signal / signal.mean())


def evened(charging: PatchCharging, fit: FittedExcitation) -> PatchCharging:
    """Divide by the evenness that a fit has found beside what earlier charges have left.

    After the first charges by the lamp itself places still glow by what charged them through the
    filter, which slow states and a kinetic order above 1 keep for long.

    Parameters
    ----------
    charging
        Charging of a patch.
    fit
        Fit of it.
    """
    factor = 1 / fit.evenness[:, None]

    def divided(series: ChargingSeries) -> ChargingSeries:
        return replace(series, values=series.values * factor, sigma=series.sigma * factor)

    through, veils = divided(charging.through), charging.through.frame_light
    return replace(
        charging,
        through=through if veils is None else replace(through, frame_light=veils * factor),
        direct=divided(charging.direct),
        evenness=charging.evenness * fit.evenness,
    )


#: Weight from which a site is not known where another one is not.
DEPENDS = 0.01


def site_weights(slices: Slices, irradiance: IrradianceFile, layout: SensorLayout) -> FloatArray:
    """Return the weights (C, P, P) of the slices' means in those of the sites.

    Parameters
    ----------
    slices
        Regions in which the means were measured.
    irradiance
        Positions of the sites' middles along the filter.
    layout
        Size and colours of the sensor.
    """
    strip, position = irradiance.lvf_strip(), np.array(irradiance.position)
    rising = np.argsort(position)
    integral = CubicSpline(position[rising], np.eye(len(position))[rising]).antiderivative()
    half = 0.5 / len(position)
    of_sites = (integral(position + half) - integral(position - half)) / (2 * half)
    left, right = strip.left[0] * layout.width, strip.right[0] * layout.width
    of_slices = np.empty((len(layout.channels), *of_sites.shape))
    offsets = tilt_offset(strip, slices, layout)
    for number, (region, offset) in enumerate(zip(slices.values(), offsets, strict=True)):
        first, weights = layout.column_weights(region)
        edges = (np.arange(first, first + weights.shape[1] + 1) - left) / (right - left) + offset
        along = edges if strip.rising else 1 - edges
        of_columns = np.diff(integral(along), axis=0) / np.diff(along)[:, None]
        of_slices[:, number] = weights @ of_columns
    return np.asarray(of_sites @ np.linalg.inv(of_slices))


def site_means(
    values: FloatArray, sigma: FloatArray, usable: BoolArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return means over sites and their σ, shape (n, P, C) each; NaN where they are not known.

    Parameters
    ----------
    values, sigma
        Means over slices and their σ, shape (n, P, C).
    usable
        Whether a slice must be used, shape (n, P).
    weights
        Weights of the slices by `site_weights`.
    """
    means = np.einsum("cpq,fqc->fpc", weights, values)
    mean_sigma = np.sqrt(np.einsum("cpq,fqc->fpc", weights**2, sigma**2))
    depends = (np.abs(weights) > DEPENDS).any(axis=0)
    is_known = (usable[:, None, :] | ~depends).all(axis=2, keepdims=True)
    return np.where(is_known, means, np.nan), np.where(is_known, mean_sigma, np.nan)


#: Name of the region around all sites, from which the initial rates are taken.
WHOLE = "whole strip"
#: Name of the sample where selected lights charge all of it.
SAMPLE = "sample"
#: Name of the frame among the regions.
FRAME = "(whole frame)"
WHOLE_FRAME: Region = (0.0, 0.0, 1.0, 1.0)
#: Degree of the veil's course along the sites.
VEIL_DEGREE = 3
#: Placeholder for the values of a series.
NOTHING: FloatArray = np.empty((0, 0, 0))


def patch_chargings(
    context: AnalysisContext, irradiance: IrradianceFile, warming: Warming
) -> tuple[dict[StripPatch, PatchCharging], tuple[ResultWarning, ...]]:
    """Read and reduce all frames of the run to the charging of each patch, and warnings.

    Parameters
    ----------
    part
        Part of a run.
    irradiance
        Irradiance on the sample.
    warming
        Warm-up deficit of the lamp.

    Raises
    ------
    DataError
        Charges or frames are missing, no patch lies below the filter, the irradiance is of other
        lights, or the camera is not the calibrated one.
    UsageError
        The irradiance is that of selected lights and the run's charges went through the filter.
    """
    inputs, overrides, protocol = context.inputs, context.overrides, context.protocol
    frames = charge_frames(
        context.run, overrides, warming.time_constant_s, inputs[BLANK_KIND], context.other_parts
    )
    require_calibrated_camera(inputs[CAMERA_KIND], context.run, list(frames.charge_of))
    layout = sensor_layout(next(iter(frames.charge_of)))
    if protocol.select is None:
        strip = irradiance.lvf_strip()
        sites, reasons = slice_strip(
            strip_regions(context), strip, layout, len(irradiance.position)
        )
    else:
        _require_lights(protocol.select, irradiance)
        sites = {
            patch: {SAMPLE: patch.region or protocol.sites} for patch in strip_regions(context)
        }
        reasons = ()
    series = reduce_patches(
        [
            replace(timed(frame, frames.zero_s), unit=interval.unit)
            for frame, interval in frames.charge_of.items()
        ],
        {
            _place_name(patch, name): region
            for patch, slices in sites.items()
            for name, region in {**slices, WHOLE: _bounding_region(slices)}.items()
        }
        | {FRAME: WHOLE_FRAME},
        [
            untimed(frame)
            for frame in context.run.frames(FrameRole.DARK)
            if not overrides.excludes(frame)
        ],
        camera=inputs[CAMERA_KIND],
    )
    rise, fade = lamp_transients(inputs[FADE_KIND], np.array(irradiance.bands_nm))
    longest = max(
        (interval for interval in frames.intervals if interval.is_direct),
        key=lambda interval: interval.off_s - interval.on_s,
    )

    def charges(direct: bool) -> tuple[Charge, ...]:
        return tuple(
            _charge(
                interval,
                frames,
                warming.deficit,
                fresh=protocol.samples > 1,
                saturated=protocol.saturated and interval is longest,
                lights=irradiance.lights,
            )
            for interval in frames.intervals
            if interval.is_direct is direct
        )

    by_leds = any(interval.is_led for interval in frames.intervals)
    through = _through(irradiance, charges(False), (rise, fade), by_leds=by_leds)
    if by_leds:
        at_once = Transient.none(len(irradiance.direct))
        through = replace(through, rise=at_once, fade=at_once)
    everywhere = np.tile(irradiance.direct, (len(irradiance.position) or 1, 1))
    direct_charges = charges(True)
    earlier = EarlierCharges(through.charges, through.irradiance, through.rise, through.fade)
    is_earlier = through.charges[-1].off_s < direct_charges[0].on_s
    direct = ChargingSeries(
        "by the lamp itself", direct_charges, rise, fade, everywhere, NOTHING, NOTHING,
        earlier=earlier if is_earlier else None,
    )  # fmt: skip
    chargings = {}
    for patch, slices in sites.items():
        patch_series = [series[_place_name(patch, name)] for name in slices]
        values, sigma = (
            np.stack([getattr(each, name) for each in patch_series], axis=1)
            for name in ("values", "sigma")
        )
        usable = np.stack([each.usable for each in patch_series], axis=1)
        if irradiance.lights:
            values = np.where(usable[..., None], values, np.nan)
        else:
            weights = site_weights(slices, irradiance, layout)
            values, sigma = site_means(values, sigma, usable, weights)
        strip_series = series[_place_name(patch, WHOLE)]
        chargings[patch] = _divide_by_evenness(
            values, sigma, through, direct, strip_series, series[FRAME].values, frames
        )
    return chargings, (*frames.left_out, *reasons)


def _divide_by_evenness(
    values: FloatArray,
    sigma: FloatArray,
    through: ChargingSeries,
    direct: ChargingSeries,
    strip_series: Series,
    frame_light: FloatArray,
    frames: ChargeFrames,
) -> PatchCharging:
    """Divide one patch's values (n, P, C) of all photographs by the evenness, into two series."""
    is_direct = np.array([interval.is_direct for interval in frames.charge_of.values()])
    # What earlier charges have left is not known yet: the fit tells it from the evenness.
    even = evenness(values[is_direct], sigma[is_direct])
    values, sigma = values / even[:, None], sigma / even[:, None]
    # Direct charges define what even light is, with the veil that lies over it.
    veils = frame_light[:, None, :] / np.where(is_direct[:, None], 1.0, even)[..., None]
    is_last = np.array([interval is frames.intervals[-1] for interval in frames.charge_of.values()])
    return PatchCharging(
        replace(
            through,
            values=values[~is_direct],
            sigma=sigma[~is_direct],
            frame_light=veils[~is_direct],
            veil_shapes=None if through.is_by_light else _veil_shapes(values.shape[1]),
        ),
        replace(
            direct,
            values=values[is_direct],
            sigma=sigma[is_direct],
            frame_light=veils[is_direct],
        ),
        even,
        _final_decay(strip_series, is_last, frames),
    )


def _veil_shapes(sites: int) -> FloatArray:
    """Return smooth courses along the sites, Legendre's polynomials of low degree, shape (K, P)."""
    along = np.linspace(-1.0, 1.0, sites)
    return np.asarray(legvander(along, VEIL_DEGREE)[:, 1:].T)


def _through(
    irradiance: IrradianceFile,
    charges: tuple[Charge, ...],
    transients: tuple[Transient, Transient],
    *,
    by_leds: bool,
) -> ChargingSeries:
    """Return the series through the filter or by selected lights, without its values."""
    lit = (charges, *transients)
    if irradiance.lights:
        light = selected_light(irradiance, by_leds=by_leds)
        kinds = np.full(len(light.modes), KNOWN)
        return ChargingSeries(
            "by selected lights", *lit, light.irradiance, NOTHING, NOTHING, light.modes, kinds
        )
    return ChargingSeries(
        "through the filter", *lit, np.array(irradiance.through), NOTHING, NOTHING,
        site_modes(irradiance), mode_kinds(irradiance), across_sites(irradiance),
    )  # fmt: skip


def _require_lights(select: ExcitingLights, irradiance: IrradianceFile) -> None:
    """Raise DataError if the irradiance of one of the lights is not known."""
    unknown = [name for name in select.names() if name not in irradiance.lights]
    if unknown:
        raise DataError(
            f"expected the irradiance of every light of 'select', got none of '{unknown[0]}' "
            f"(known: {', '.join(irradiance.lights) or 'places behind the variable filter'}); run "
            "irradiance with the same 'select', and name its run ('optics: {irradiance: …}')"
        )


def _charge(
    interval: ChargeInterval,
    frames: ChargeFrames,
    deficit: float,
    *,
    fresh: bool,
    saturated: bool,
    lights: Sequence[str],
) -> Charge:
    after = frames.after(interval)
    return Charge(
        on_s=interval.on_s - frames.zero_s,
        off_s=interval.off_s - frames.zero_s,
        start_s=np.array([frame.start_time - frames.zero_s for frame in after]),
        exposure_s=np.array([frame.exposure_s for frame in after]),
        brightness=1 - deficit * interval.cold_deficit,
        cold_deficit=interval.cold_deficit,
        fresh=fresh,
        saturated=saturated,
        light=None if interval.light is None else lights.index(interval.light),
    )


def _place_name(patch: StripPatch, name: str) -> str:
    """Return the name of a place among those of all patches."""
    return f"{patch.folder} {name}".strip()


def _bounding_region(sites: Slices) -> Region:
    """Return the upright rectangle around all sites."""
    left, top = (min(region[k] for region in sites.values()) for k in (0, 1))
    right = max(region[0] + region[2] for region in sites.values())
    bottom = max(region[1] + region[3] for region in sites.values())
    return left, top, right - left, bottom - top


def _final_decay(strip_series: Series, rows: BoolArray, frames: ChargeFrames) -> Series:
    final = strip_series.take(np.flatnonzero(rows))
    return replace(final, t_s=final.t_s - (frames.intervals[-1].off_s - frames.zero_s))
