"""Photographs of the card after a switch of the lamp, and while its housing warms."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.frames import switched_time, timed, untimed
from labrig.calibration import CameraFile, Warming
from labrig.errors import DataError
from labrig.protocols.fade import LampFrames
from labrig.record import FrameRecord, RunRecord
from labrig.reduce import reduce_patches
from labrig.region import Region
from labrig.results import FloatArray, Series, SwitchedFrames, WarmingLight

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
    taken = [
        timed(frame, switched_time(attempts[frame.unit], frame, state))
        for frame in frames
        if frame.role == role
    ]
    steady = [untimed(frame) for frame in frames if frame.role == LampFrames.STEADY]
    if len(taken) < FEWEST or not steady:
        raise DataError(
            f"expected {FEWEST} photographs of the {role} or more, and of the steady lamp, got "
            f"{len(taken)} and {len(steady)}; resume the run"
        )
    dark = [untimed(frame) for frame in darks]
    series = reduce_patches([*taken, *steady], places, dark, camera=camera)
    parts = [_of_place(one, len(taken)) for one in series.values()]
    light_s, sigma_s = (np.hstack([part[number] for part in parts]) for number in (0, 1))
    first = next(iter(series.values()))
    steady_dn_per_s = np.concatenate([part[2] for part in parts])
    seen = np.isfinite(light_s).any(axis=1)
    if np.count_nonzero(seen) < FEWEST:
        raise DataError(
            f"expected {FEWEST} photographs of the {role} that do not clip, got "
            f"{np.count_nonzero(seen)}; lower camera.iso"
        )
    clips = ~np.all([one.usable[: len(taken)] for one in series.values()], axis=0)
    return SwitchedFrames(
        first.t_s[: len(taken)][seen],
        first.exposure_s[: len(taken)][seen],
        light_s[seen],
        sigma_s[seen],
        steady_dn_per_s,
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
    )


def _of_place(series: Series, taken: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return light and σ of the `taken` photographs, (n, C) each, and the steady signal (C,)."""
    unit = np.array(series.unit)
    is_steady = np.arange(len(unit)) >= taken
    value, sigma = np.full((2, taken, len(series.channels)), np.nan)
    for one in dict.fromkeys(series.unit):
        reference = is_steady & (unit == one) & series.usable
        own = np.flatnonzero(~is_steady & (unit == one) & series.usable)
        if not reference.any() or not len(own):
            continue
        level = series.values[reference].mean(axis=0)
        exposure_s = series.exposure_s[own][:, np.newaxis]
        known = level > 0
        safe = np.where(known, level, 1.0)
        value[own] = np.where(known, series.values[own] * exposure_s / safe, np.nan)
        sigma[own] = np.where(known, series.sigma[own] * exposure_s / safe, np.nan)
    steady = series.values[is_steady & series.usable]
    if not len(steady):
        raise DataError("the steady lamp clips in all frames; lower camera.iso")
    return value, sigma, steady.mean(axis=0)


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
    on = switched_time(run.completed()[frames[0].unit], frames[0], "on")
    series = reduce_patches(
        [timed(frame, on) for frame in frames],
        {"card": card},
        [untimed(frame) for frame in darks],
        camera=camera,
    )["card"]
    used = series.usable
    values, sigma = series.values[used], np.nan_to_num(series.sigma[used])
    best = int(np.argmax(np.mean(values, axis=0)))
    t_s, level = series.t_s[used], values[:, best]
    unsure = np.hypot(sigma[:, best], flicker * level)
    found = [_fit_warming(t_s, level / unsure, 1 / unsure, tau) for tau in TAU_S]
    chi2 = np.array([one[2] for one in found])
    weight = np.exp(-(chi2 - chi2.min()) / 2)
    weight /= weight.sum()
    deficit = np.array([one[0] for one in found])
    own = np.array([one[1] for one in found])
    mean = float(weight @ deficit)
    spread = float(np.sqrt(weight @ (own**2 + (deficit - mean) ** 2)))
    at = int(np.argmin(chi2))
    file = Warming(deficit=max(mean, 0.0), deficit_sigma=spread, time_constant_s=float(TAU_S[at]))
    return file, WarmingLight(t_s, level / found[at][3])


def _fit_warming(
    t_s: FloatArray, level: FloatArray, one: FloatArray, tau_s: float
) -> tuple[float, float, float, float]:
    """Return the deficit and its σ, χ², and the warm lamp's level.

    Values are in units of their σ, and `one` is the warm light in that unit.
    """
    rows = np.stack([one, -one * np.exp(-t_s / tau_s)], axis=1)
    covariance = np.linalg.inv(rows.T @ rows)
    warm, less = covariance @ (rows.T @ level)
    deficit = less / warm
    slope = np.array([-deficit, 1.0]) / warm
    left = level - rows @ [warm, less]
    sigma = float(np.sqrt(slope @ covariance @ slope))
    return float(deficit), sigma, float(left @ left), float(warm)
