"""Photographs of the card after a switch of the lamp, and while its housing warms."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.frames import switched_time, timed, untimed
from labrig.calibration import CameraFile, Warming
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.protocols.fade.protocol import LampFrames
from labrig.protocols.fade.result import SwitchedFrames, WarmingLight
from labrig.record import FrameRecord, RunRecord
from labrig.reduce import reduce_patches
from labrig.results import Series

#: Fewest photographs of a transient.
FEWEST = 6
#: Time constants of a housing in seconds that are compared.
TAU_S: FloatArray = np.geomspace(15.0, 1500.0, 93)


def frames_after_switch(
    run: RunRecord,
    frames: Sequence[FrameRecord],
    darks: Sequence[FrameRecord],
    places: Mapping[str, Region],
    camera: CameraFile | None,
    role: str,
) -> SwitchedFrames:
    """Return photographs of a transient relative to those of the steady lamp in their pass.

    Parameters
    ----------
    run
        A recorded run.
    frames
        Frames of that role, and those of the steady lamp.
    darks
        Dark frames.
    places
        Regions on the card by name.
    camera
        Calibration of the camera; None if there is none.
    role
        Role of the frames, `fade` or `rise`.

    Raises
    ------
    DataError
        Too few of the frames are usable.
    """
    state = "on" if role == LampFrames.RISE else "off"
    attempts = run.completed()
    switched = [
        timed(frame, switched_time(attempts[frame.unit], frame, state))
        for frame in frames
        if frame.role == role
    ]
    steady = [untimed(frame) for frame in frames if frame.role == LampFrames.STEADY]
    if len(switched) < FEWEST or not steady:
        raise DataError(
            f"expected {FEWEST} photographs of the {role} or more, and of the steady lamp, got "
            f"{len(switched)} and {len(steady)}; resume the run"
        )
    dark = [untimed(frame) for frame in darks]
    series = reduce_patches([*switched, *steady], places, dark, camera=camera)
    parts = [_place_light(place_series, len(switched)) for place_series in series.values()]
    light_s, sigma_s = (np.hstack([part[number] for part in parts]) for number in (0, 1))
    first = next(iter(series.values()))
    steady_dn_per_s, dark_sigma_dn_per_s = (
        np.concatenate([part[number] for part in parts]) for number in (2, 3)
    )
    unclipped = np.isfinite(light_s).any(axis=1)
    if np.count_nonzero(unclipped) < FEWEST:
        raise DataError(
            f"expected {FEWEST} photographs of the {role} that do not clip, got "
            f"{np.count_nonzero(unclipped)}; lower camera.iso"
        )
    unit = np.array(first.unit)
    passes, pass_number = np.unique(unit[: len(switched)][unclipped], return_inverse=True)
    references = unit[len(switched) :][first.usable[len(switched) :]]
    clips = ~np.all(
        [place_series.usable[: len(switched)] for place_series in series.values()], axis=0
    )
    return SwitchedFrames(
        first.t_s[: len(switched)][unclipped],
        first.exposure_s[: len(switched)][unclipped],
        light_s[unclipped],
        sigma_s[unclipped],
        steady_dn_per_s,
        dark_sigma_dn_per_s,
        pass_number=pass_number,
        steady_frames=np.array([np.count_nonzero(references == name) for name in passes]),
        clipped=int(np.count_nonzero(clips)),
    )


def brightest_channels(frames: SwitchedFrames, channels: int) -> NDArray[np.intp]:
    """Return the columns of the brightest channel in every place, shape (S / channels,)."""
    places = frames.steady_dn_per_s.reshape(-1, channels)
    columns: NDArray[np.intp] = np.arange(len(places)) * channels + places.argmax(axis=1)
    return columns


def take_columns(frames: SwitchedFrames, columns: NDArray[np.intp]) -> SwitchedFrames:
    """Return the given places or colours."""
    return replace(
        frames,
        light_s=frames.light_s[:, columns],
        light_sigma_s=frames.light_sigma_s[:, columns],
        steady_dn_per_s=frames.steady_dn_per_s[columns],
        dark_sigma_dn_per_s=frames.dark_sigma_dn_per_s[columns],
    )


def _place_light(
    series: Series, count: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return light and σ of the first `count` photographs, steady signal and σ of the dark level.

    The first two are (n, C), the others (C,).
    """
    unit = np.array(series.unit)
    is_steady = np.arange(len(unit)) >= count
    value, sigma = np.full((2, count, len(series.channels)), np.nan)
    for name in dict.fromkeys(series.unit):
        reference = is_steady & (unit == name) & series.usable
        rows = np.flatnonzero(~is_steady & (unit == name) & series.usable)
        if not reference.any() or not len(rows):
            continue
        level = series.values[reference].mean(axis=0)
        exposure_s = series.exposure_s[rows][:, np.newaxis]
        is_lit = level > 0
        divisor = np.where(is_lit, level, 1.0)
        value[rows] = np.where(is_lit, series.values[rows] * exposure_s / divisor, np.nan)
        sigma[rows] = np.where(is_lit, series.sigma[rows] * exposure_s / divisor, np.nan)
    steady = series.values[is_steady & series.usable]
    if not len(steady):
        raise DataError("the steady lamp clips in all frames; lower camera.iso")
    # A series without dark frames does not know it.
    return value, sigma, steady.mean(axis=0), np.nan_to_num(series.dark_sigma)


def warming(
    run: RunRecord,
    frames: Sequence[FrameRecord],
    darks: Sequence[FrameRecord],
    card: Region,
    camera: CameraFile | None,
    flicker: float,
) -> tuple[Warming, WarmingLight]:
    """Fit the warm-up deficit of the lamp, and return the light that it was fitted to.

    The light is 1 − d e^(−t/τ) of that of the warm lamp, by the housing's Newtonian warming.
    """
    on_time = switched_time(run.completed()[frames[0].unit], frames[0], "on")
    series = reduce_patches(
        [timed(frame, on_time) for frame in frames],
        {"card": card},
        [untimed(frame) for frame in darks],
        camera=camera,
    )["card"]
    usable = series.usable
    values, sigma = series.values[usable], np.nan_to_num(series.sigma[usable])
    best = int(np.argmax(np.mean(values, axis=0)))
    t_s, level = series.t_s[usable], values[:, best]
    level_sigma = np.hypot(sigma[:, best], flicker * level)
    fits = [_fit_warming(t_s, level / level_sigma, 1 / level_sigma, tau) for tau in TAU_S]
    chi2 = np.array([fit[2] for fit in fits])
    weight = np.exp(-(chi2 - chi2.min()) / 2)
    weight /= weight.sum()
    deficit = np.array([fit[0] for fit in fits])
    deficit_sigma = np.array([fit[1] for fit in fits])
    mean = float(weight @ deficit)
    spread = float(np.sqrt(weight @ (deficit_sigma**2 + (deficit - mean) ** 2)))
    best_fit = int(np.argmin(chi2))
    file = Warming(
        deficit=max(mean, 0.0), deficit_sigma=spread, time_constant_s=float(TAU_S[best_fit])
    )
    return file, WarmingLight(t_s, level / fits[best_fit][3])


def _fit_warming(
    t_s: FloatArray, level: FloatArray, inverse_sigma: FloatArray, tau_s: float
) -> tuple[float, float, float, float]:
    """Return the deficit and its σ, χ², and the warm lamp's level.

    The light is given in units of its σ.
    """
    rows = np.stack([inverse_sigma, -inverse_sigma * np.exp(-t_s / tau_s)], axis=1)
    covariance = np.linalg.inv(rows.T @ rows)
    warm_level, missing_level = covariance @ (rows.T @ level)
    deficit = missing_level / warm_level
    slope = np.array([-deficit, 1.0]) / warm_level
    residual = level - rows @ [warm_level, missing_level]
    sigma = float(np.sqrt(slope @ covariance @ slope))
    return float(deficit), sigma, float(residual @ residual), float(warm_level)
