"""From a run's frames to charging series: every charge with the photographs after it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial.legendre import legvander

from labrig.analyse.frames import require_calibrated_camera, timed, untimed
from labrig.analyse.inputs import Part
from labrig.analyse.strip import Slices, StripPatch, slice_strip, strip_regions
from labrig.calibration import BLANK_KIND, CAMERA_KIND, FADE_KIND, IrradianceFile, Warming
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.protocols.excitation.analysis.charge_intervals import (
    ChargeFrames,
    ChargeInterval,
    charge_frames,
)
from labrig.protocols.excitation.analysis.evenness import evenness
from labrig.protocols.excitation.analysis.lamp_light import (
    KNOWN,
    across_sites,
    lamp_transients,
    mode_kinds,
    site_modes,
)
from labrig.protocols.excitation.analysis.selected_light import selected_light
from labrig.protocols.excitation.analysis.site_means import site_means, site_weights
from labrig.protocols.excitation.result import PatchCharging
from labrig.protocols.steps.exciting_lights import ExcitingLights
from labrig.record import FrameRole
from labrig.reduce import reduce_patches, sensor_layout
from labrig.results import Charge, ChargingSeries, EarlierCharges, Series, Transient

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
    part: Part, irradiance: IrradianceFile, warming: Warming
) -> tuple[dict[StripPatch, PatchCharging], tuple[str, ...]]:
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
    inputs, overrides, protocol = part.inputs, part.overrides, part.protocol
    frames = charge_frames(
        part.run, overrides, warming.time_constant_s, inputs[BLANK_KIND], part.beside
    )
    require_calibrated_camera(inputs[CAMERA_KIND], part.run, list(frames.charge_of))
    layout = sensor_layout(next(iter(frames.charge_of)))
    if protocol.select is None:
        strip = irradiance.lvf_strip()
        sites, reasons = slice_strip(strip_regions(part), strip, layout, len(irradiance.position))
    else:
        _require_lights(protocol.select, irradiance)
        sites = {patch: {SAMPLE: patch.region or protocol.sites} for patch in strip_regions(part)}
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
            for frame in part.run.frames(FrameRole.DARK)
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
