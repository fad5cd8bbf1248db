"""From a run's frames to charging series: every charge with the photographs after it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.calibration.irradiance_file import IrradianceFile
from labrig.errors import DataError
from labrig.fit.excitation import Charge, ChargingSeries, Transient
from labrig.process.choices import Choices
from labrig.process.excitation.centring import centred
from labrig.record import Attempt, FrameRecord, RunRecord
from labrig.reduce import Series, SeriesFrame, read_raw, reduce_patches

FloatArray = NDArray[np.float64]

#: Frames that show the glow after a charge; those of a metering are exposed too long or too short.
GLOWING = ("strip", "bare", "rest")
#: Units that charged by the lamp itself; all others charged through the filter.
BARE = "bare-"
#: Of the light on a place alone, whatever its file says.
LEAST_SITE_SIGMA = 3e-3
#: Of a filter's wavelengths, and what an error of its width does at a band's edge.
WAVELENGTH_SIGMA_NM = 1.0
#: Errors of places so many parts of the filter apart have nothing in common: some 40 nm.
SMOOTH_MODES = 9
#: A halogen lamp's housing and mirror warm about that fast, and the last per cents of light with
#: them.
WARMS_S = 150.0
#: All of the strip, from which the rates to start with are taken.
WHOLE = "whole strip"


@dataclass(frozen=True)
class Charged:
    """What was measured.

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


@dataclass(frozen=True)
class _Lit:
    """A unit that charged."""

    unit: str
    on_s: float
    off_s: float

    @property
    def is_bare(self) -> bool:
        return self.unit.startswith(BARE)


def charged(
    run: RunRecord,
    irradiance: IrradianceFile,
    rise: Transient,
    fade: Transient,
    choices: Choices,
    *,
    fresh: bool,
    saturated: bool,
) -> Charged:
    """Read and reduce all frames of the run.

    Parameters
    ----------
    rise, fade
        In the bands of `irradiance`.
    fresh
        Whether every charge found a sample that had never seen light.
    saturated
        Take the longest bare charge for a full one.

    Raises
    ------
    DataError
        Charges or frames are missing.
    """
    lit = sorted(
        (one for attempt in run.completed().values() for one in _lit(attempt)),
        key=lambda one: one.on_s,
    )
    frames = [
        frame for purpose in GLOWING for frame in run.frames(purpose) if not choices.excludes(frame)
    ]
    frames.sort(key=lambda frame: frame.start_time)
    if not any(one.is_bare for one in lit) or all(one.is_bare for one in lit):
        raise DataError(
            f"{run.folder}: expected complete charges through the filter and without it; go on "
            f"with: labrig resume {run.folder}"
        )
    after = {frame: _charge_before(lit, frame) for frame in frames}
    kept = [frame for frame in frames if after[frame] is not None]
    sites = irradiance.strip.slices(len(irradiance.position))
    zero_s = lit[0].on_s
    series = reduce_patches(
        [_frame(frame, zero_s, after[frame]) for frame in kept],
        {**sites, WHOLE: _around(sites)},
        [_frame(frame, 0.0) for frame in run.frames("dark") if not choices.excludes(frame)],
    )
    raw = read_raw(kept[0].path)
    position = np.array(irradiance.position)
    values = np.stack([_blanked(series[name], series[name].values) for name in sites], axis=1)
    values = centred(values, sites, position, irradiance.strip, raw)
    sigma = np.stack([_blanked(series[name], series[name].sigma) for name in sites], axis=1)
    is_bare = np.array([_of(after, frame).is_bare for frame in kept])
    evenness = _evenness(values[is_bare], sigma[is_bare])
    even = values / evenness[:, None], sigma / evenness[:, None]
    longest = max((one for one in lit if one.is_bare), key=lambda one: one.off_s - one.on_s)
    through, bare = (
        ChargingSeries(
            name=name,
            charges=tuple(
                Charge(
                    on_s=one.on_s - zero_s,
                    off_s=one.off_s - zero_s,
                    start_s=_times(kept, after, one, zero_s),
                    exposure_s=np.array([f.exposure_s for f in kept if after[f] is one]),
                    cold=_cold(one.off_s - one.on_s),
                    fresh=fresh,
                    saturated=saturated and one is longest,
                )
                for one in lit
                if one.is_bare is wanted
            ),
            rise=rise,
            fade=fade,
            irradiance=light,
            values=even[0][is_bare == wanted],
            sigma=even[1][is_bare == wanted],
            site_modes=site_modes,
        )
        for name, wanted, light, site_modes in (
            (
                "through the filter",
                False,
                np.array(irradiance.through),
                _site_modes(irradiance),
            ),
            ("by the lamp itself", True, np.tile(irradiance.direct, (len(sites), 1)), None),
        )
    )
    whole = series[WHOLE]
    last = np.array([_of(after, frame) is lit[-1] for frame in kept])
    return Charged(
        through, bare, evenness, _after_off(whole, last, lit[-1], zero_s), whole.channels
    )


def _lit(attempt: Attempt) -> Sequence[_Lit]:
    times = {
        action.action: (action.start_time + action.end_time) / 2
        for action in attempt.actions
        if action.device == "lamp"
    }
    return [_Lit(attempt.unit, times["on"], times["off"])] if {"on", "off"} <= set(times) else []


def _charge_before(lit: Sequence[_Lit], frame: FrameRecord) -> _Lit | None:
    """The last one; None if there was none in the same arrangement of filter and lamp."""
    before = [one for one in lit if one.off_s < frame.start_time]
    if not before or before[-1].is_bare is not frame.unit.startswith(BARE):
        return None
    return before[-1]


def _of(after: Mapping[FrameRecord, _Lit | None], frame: FrameRecord) -> _Lit:
    found = after[frame]
    assert found is not None, "frames before the first charge were left out"
    return found


def _frame(frame: FrameRecord, zero_s: float, charge: _Lit | None = None) -> SeriesFrame:
    return SeriesFrame(
        frame.path,
        frame.start_time - zero_s,
        frame.exposure_s,
        frame.iso,
        frame.f_number,
        frame.unit if charge is None else charge.unit,
    )


def _times(
    frames: Sequence[FrameRecord],
    after: Mapping[FrameRecord, _Lit | None],
    charge: _Lit,
    zero_s: float,
) -> FloatArray:
    return np.array([f.start_time - zero_s for f in frames if after[f] is charge])


def _blanked(series: Series, numbers: FloatArray) -> FloatArray:
    """NaN where a row must not be used."""
    return np.where(series.usable[:, None], numbers, np.nan)


def _around(
    sites: Mapping[str, tuple[float, float, float, float]],
) -> tuple[float, float, float, float]:
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


def _cold(charge_s: float) -> float:
    """Mean of e^(−t/τ) over a charge: how cold the lamp was, on average."""
    return float(-np.expm1(-charge_s / WARMS_S) * WARMS_S / charge_s)


def _site_modes(irradiance: IrradianceFile) -> FloatArray:
    """(M, P, B): what is said of each place's light, alike for neighbours, and a little of its own.

    Camera curves, the filter's widths and its wavelengths are wrong smoothly along the filter; the
    latter two move light from band to band.
    """
    through, sigma = np.array(irradiance.through), np.array(irradiance.through_sigma)
    told = np.sqrt((sigma**2).sum(axis=1)) / np.maximum(through.sum(axis=1), 1e-300)
    position = np.array(irradiance.position)
    knots = np.linspace(position[0], position[-1], SMOOTH_MODES)
    share = np.clip(1 - np.abs(position - knots[:, None]) / (knots[1] - knots[0]), 0.0, None)
    smooth = np.sin(np.pi / 2 * share)[..., None]
    nm = np.ptp(irradiance.bands_nm) * (position - position[0]) / np.ptp(position)
    by_nm = np.gradient(np.log(np.maximum(through, 1e-6 * through.max())), nm, axis=0)
    bands = np.ones(through.shape[1])
    alone = LEAST_SITE_SIGMA * np.eye(len(position))[..., None]
    return np.concatenate(
        [smooth * told[:, None] * bands, smooth * WAVELENGTH_SIGMA_NM * by_nm, alone * bands]
    )


def _after_off(whole: Series, rows: NDArray[np.bool_], charge: _Lit, zero_s: float) -> Series:
    part = whole.take(np.flatnonzero(rows))
    return replace(part, t_s=part.t_s - (charge.off_s - zero_s))
