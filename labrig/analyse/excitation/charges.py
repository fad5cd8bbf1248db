"""From a run's frames to charging series: every charge with the photographs after it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.excitation.centring import centred
from labrig.analyse.excitation.lamp_changes import lamp_changes
from labrig.analyse.excitation.light import across_sites, site_modes
from labrig.analyse.excitation.lit import Glowing, Lit, glowing
from labrig.analyse.part import Part
from labrig.analyse.strip_patches import Slices, StripPatch, cut, strip_patches
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import timed, untimed
from labrig.calibration import Warming
from labrig.calibration.irradiance_file import IrradianceFile
from labrig.errors import DataError
from labrig.fit.excitation import Charge, ChargingSeries
from labrig.reduce import read_raw, reduce_patches
from labrig.region import Region
from labrig.results import Series

FloatArray = NDArray[np.float64]

#: All of the strip, from which the rates to start with are taken.
WHOLE = "whole strip"
#: Of a series whose values are still to come.
NOTHING: FloatArray = np.empty((0, 0, 0))


@dataclass(frozen=True)
class Charged:
    """What was measured of one patch.

    Attributes
    ----------
    through, bare
        Charges through the filter and by the lamp itself, at the same places; values are even:
        what lens and sample do from place to place is divided out.
    evenness
        (P,) by which they were divided.
    whole
        The whole strip after the last bare charge, for a decay fit.
    channels
        Names.
    """

    through: ChargingSeries
    bare: ChargingSeries
    evenness: FloatArray
    whole: Series
    channels: tuple[str, ...]


def charged(
    part: Part, irradiance: IrradianceFile, warming: Warming
) -> tuple[dict[StripPatch, Charged], tuple[str, ...]]:
    """Read and reduce all frames of the run: what each patch shows, and what to say of the rest.

    Parameters
    ----------
    irradiance
        On the sample.
    warming
        What the lamp lacks while its housing is cold.

    Raises
    ------
    DataError
        Charges or frames are missing, no patch lies below the filter, or the camera was not this
        one.
    """
    known, choices, protocol = part.inputs, part.choices, part.protocol
    glow = glowing(part.run, choices, warming.warms_s, known.blank)
    insist_on_this_camera(known.camera, part.run, list(glow.charge))
    raw = read_raw(next(iter(glow.charge)).path)
    sites, refused = cut(strip_patches(part), irradiance.strip, raw, len(irradiance.position))
    series = reduce_patches(
        [replace(timed(frame, glow.zero_s), unit=one.unit) for frame, one in glow.charge.items()],
        {
            _key(patch, name): region
            for patch, slices in sites.items()
            for name, region in {**slices, WHOLE: _around(slices)}.items()
        },
        [untimed(frame) for frame in part.run.frames("dark") if not choices.excludes(frame)],
        camera=known.camera,
    )
    rise, fade = lamp_changes(known.fade, np.array(irradiance.bands_nm))
    longest = max((one for one in glow.lit if one.is_bare), key=lambda one: one.off_s - one.on_s)

    def charges(bare: bool) -> tuple[Charge, ...]:
        return tuple(
            _charge(
                one,
                glow,
                warming.lacks,
                fresh=protocol.samples > 1,
                saturated=protocol.saturated and one is longest,
            )
            for one in glow.lit
            if one.is_bare is bare
        )

    through = ChargingSeries(
        "through the filter", charges(False), rise, fade, np.array(irradiance.through),
        NOTHING, NOTHING, site_modes(irradiance), across_sites(irradiance),
    )  # fmt: skip
    direct = np.tile(irradiance.direct, (len(irradiance.position), 1))
    bare = ChargingSeries(
        "by the lamp itself", charges(True), rise, fade, direct, NOTHING, NOTHING
    )  # fmt: skip
    found = {}
    for patch, slices in sites.items():
        own = [series[_key(patch, name)] for name in slices]
        values = np.stack([_blanked(one, one.values) for one in own], axis=1)
        sigma = np.stack([_blanked(one, one.sigma) for one in own], axis=1)
        values = centred(values, slices, np.array(irradiance.position), irradiance.strip, raw)
        whole = series[_key(patch, WHOLE)]
        found[patch] = _evened(values, sigma, through, bare, whole, glow)
    return found, (*glow.left_out, *refused)


def _evened(
    values: FloatArray,
    sigma: FloatArray,
    through: ChargingSeries,
    bare: ChargingSeries,
    whole: Series,
    glow: Glowing,
) -> Charged:
    """One patch: (n, P, C) of all photographs, brought into the two series."""
    is_bare = np.array([one.is_bare for one in glow.charge.values()])
    evenness = _evenness(values[is_bare], sigma[is_bare])
    values, sigma = values / evenness[:, None], sigma / evenness[:, None]
    last = np.array([one is glow.lit[-1] for one in glow.charge.values()])
    return Charged(
        replace(through, values=values[~is_bare], sigma=sigma[~is_bare]),
        replace(bare, values=values[is_bare], sigma=sigma[is_bare]),
        evenness,
        _after_off(whole, last, glow),
        whole.channels,
    )


def _charge(one: Lit, glow: Glowing, lacks: float, *, fresh: bool, saturated: bool) -> Charge:
    frames = glow.after(one)
    return Charge(
        on_s=one.on_s - glow.zero_s,
        off_s=one.off_s - glow.zero_s,
        start_s=np.array([frame.start_time - glow.zero_s for frame in frames]),
        exposure_s=np.array([frame.exposure_s for frame in frames]),
        brightness=1 - lacks * one.cold,
        cold=one.cold,
        fresh=fresh,
        saturated=saturated,
    )


def _key(patch: StripPatch, name: str) -> str:
    """Of a place among those of all patches."""
    return f"{patch.folder} {name}".strip()


def _blanked(series: Series, numbers: FloatArray) -> FloatArray:
    """NaN where a row must not be used."""
    return np.where(series.usable[:, None], numbers, np.nan)


def _around(sites: Slices) -> Region:
    """The upright rectangle around all sites."""
    left, top = (min(region[k] for region in sites.values()) for k in (0, 1))
    right = max(region[0] + region[2] for region in sites.values())
    bottom = max(region[1] + region[3] for region in sites.values())
    return left, top, right - left, bottom - top


def _evenness(values: FloatArray, sigma: FloatArray) -> FloatArray:
    """(P,) how bright every place is after the same light, 1 on average; all frames together."""
    weight = np.where(np.isfinite(values) & (sigma > 0), 1 / np.square(sigma), 0.0)
    known = weight.min(axis=1, keepdims=True) > 0
    frame = np.where(known, np.nanmean(np.where(known, values, 0.0), axis=1, keepdims=True), 0.0)
    weight = np.where(known, weight, 0.0)
    total = (weight * frame**2).sum(axis=(0, 2))
    if not (total > 0).all():
        raise DataError(
            "expected a glow all along the filter's place after charges by the lamp itself, got "
            "none somewhere, or it is clipped; check where the sample and the filter lie"
        )
    found = (weight * frame * np.nan_to_num(values)).sum(axis=(0, 2)) / total
    return np.asarray(found / found.mean())


def _after_off(whole: Series, rows: NDArray[np.bool_], glow: Glowing) -> Series:
    part = whole.take(np.flatnonzero(rows))
    return replace(part, t_s=part.t_s - (glow.lit[-1].off_s - glow.zero_s))
