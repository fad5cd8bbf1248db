"""From a run's frames to charging series: every charge with the photographs after it."""

from dataclasses import replace

import numpy as np

from labrig.analyse.excitation.charge_intervals import ChargeFrames, ChargeInterval, charge_frames
from labrig.analyse.excitation.evenness import evenness
from labrig.analyse.excitation.lamp_light import (
    across_sites,
    lamp_transients,
    mode_kinds,
    site_modes,
)
from labrig.analyse.frames import require_calibrated_camera, timed, untimed
from labrig.analyse.inputs import Part
from labrig.analyse.strip import Slices, StripPatch, slice_strip, strip_regions, tilt_offset
from labrig.calibration import IrradianceFile, Warming
from labrig.optics import Strip
from labrig.record import FrameRole
from labrig.reduce import SensorLayout, reduce_patches, sensor_layout
from labrig.region import Region
from labrig.results import (
    BoolArray,
    Charge,
    ChargingSeries,
    EarlierCharges,
    FloatArray,
    PatchCharging,
    Series,
)

#: Name of the region around all sites, from which the initial rates are taken.
WHOLE = "whole strip"
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
        Charges or frames are missing, no patch lies below the filter, or the camera is not the
        calibrated one.
    """
    inputs, overrides, protocol = part.inputs, part.overrides, part.protocol
    frames = charge_frames(part.run, overrides, warming.time_constant_s, inputs.blank)
    require_calibrated_camera(inputs.camera, part.run, list(frames.charge_of))
    layout = sensor_layout(next(iter(frames.charge_of)))
    sites, reasons = slice_strip(
        strip_regions(part), irradiance.strip, layout, len(irradiance.position)
    )
    series = reduce_patches(
        [
            replace(timed(frame, frames.zero_s), unit=interval.unit)
            for frame, interval in frames.charge_of.items()
        ],
        {
            _place_name(patch, name): region
            for patch, slices in sites.items()
            for name, region in {**slices, WHOLE: _bounding_region(slices)}.items()
        },
        [
            untimed(frame)
            for frame in part.run.frames(FrameRole.DARK)
            if not overrides.excludes(frame)
        ],
        camera=inputs.camera,
    )
    rise, fade = lamp_transients(inputs.fade, np.array(irradiance.bands_nm))
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
            )
            for interval in frames.intervals
            if interval.is_direct is direct
        )

    through = ChargingSeries(
        "through the filter", charges(False), rise, fade, np.array(irradiance.through),
        NOTHING, NOTHING, site_modes(irradiance), mode_kinds(irradiance), across_sites(irradiance),
    )  # fmt: skip
    everywhere = np.tile(irradiance.direct, (len(irradiance.position), 1))
    direct_charges = charges(True)
    is_earlier = through.charges[-1].off_s < direct_charges[0].on_s
    direct = ChargingSeries(
        "by the lamp itself", direct_charges, rise, fade, everywhere, NOTHING, NOTHING,
        earlier=EarlierCharges(through.charges, through.irradiance) if is_earlier else None,
    )  # fmt: skip
    chargings = {}
    for patch, slices in sites.items():
        patch_series = [series[_place_name(patch, name)] for name in slices]
        values = np.stack(
            [_with_unusable_nan(site_series, site_series.values) for site_series in patch_series],
            axis=1,
        )
        sigma = np.stack(
            [_with_unusable_nan(site_series, site_series.sigma) for site_series in patch_series],
            axis=1,
        )
        values = _interpolate_to_positions(
            values, slices, np.array(irradiance.position), irradiance.strip, layout
        )
        strip_series = series[_place_name(patch, WHOLE)]
        chargings[patch] = _divide_by_evenness(values, sigma, through, direct, strip_series, frames)
    return chargings, (*frames.left_out, *reasons)


def _interpolate_to_positions(
    values: FloatArray,
    slices: Slices,
    position: FloatArray,
    strip: Strip,
    layout: SensorLayout,
) -> FloatArray:
    """Interpolate values (n, P, C) to the positions (P,) along the strip, by the neighbours' slope.

    A slice consists of whole pixels, and some of a Bayer cell's colours lie left of others: a
    channel's value of a slice belongs to a place up to a pixel away from the slice's middle. Along
    the filter the glow is steep, so that a pixel matters where slices are a few pixels wide.

    Parameters
    ----------
    values
        Values of the slices.
    slices
        Regions in which the values were measured.
    position
        Positions along the strip, 0 at the blue end to 1 at the red end.
    strip
        Place of the strip.
    layout
        Size and colours of the sensor.
    """
    along = position if strip.rising else 1 - position
    left, right = strip.left[0] * layout.width, strip.right[0] * layout.width
    centre_column = left + (along - tilt_offset(strip, slices, layout)) * (right - left)
    interpolated = values.copy()
    middles = np.array([layout.middle_columns(region) for region in slices.values()])
    for number, x in enumerate(middles.T):
        slope = np.nan_to_num(np.gradient(values[..., number], x, axis=1))
        interpolated[..., number] += slope * (centre_column - x)
    return interpolated


def _divide_by_evenness(
    values: FloatArray,
    sigma: FloatArray,
    through: ChargingSeries,
    direct: ChargingSeries,
    strip_series: Series,
    frames: ChargeFrames,
) -> PatchCharging:
    """Divide one patch's values (n, P, C) of all photographs by the evenness, into two series."""
    is_direct = np.array([interval.is_direct for interval in frames.charge_of.values()])
    # What earlier charges have left is not known yet: `evened` takes it into account.
    even = evenness(values[is_direct], sigma[is_direct], np.ones(1))
    values, sigma = values / even[:, None], sigma / even[:, None]
    is_last = np.array([interval is frames.intervals[-1] for interval in frames.charge_of.values()])
    return PatchCharging(
        replace(through, values=values[~is_direct], sigma=sigma[~is_direct]),
        replace(direct, values=values[is_direct], sigma=sigma[is_direct]),
        even,
        _final_decay(strip_series, is_last, frames),
    )


def _charge(
    interval: ChargeInterval, frames: ChargeFrames, deficit: float, *, fresh: bool, saturated: bool
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
    )


def _place_name(patch: StripPatch, name: str) -> str:
    """Return the name of a place among those of all patches."""
    return f"{patch.folder} {name}".strip()


def _with_unusable_nan(series: Series, numbers: FloatArray) -> FloatArray:
    """Replace numbers by NaN in rows that must not be used."""
    return np.where(series.usable[:, None], numbers, np.nan)


def _bounding_region(sites: Slices) -> Region:
    """Return the upright rectangle around all sites."""
    left, top = (min(region[k] for region in sites.values()) for k in (0, 1))
    right = max(region[0] + region[2] for region in sites.values())
    bottom = max(region[1] + region[3] for region in sites.values())
    return left, top, right - left, bottom - top


def _final_decay(strip_series: Series, rows: BoolArray, frames: ChargeFrames) -> Series:
    final = strip_series.take(np.flatnonzero(rows))
    return replace(final, t_s=final.t_s - (frames.intervals[-1].off_s - frames.zero_s))
