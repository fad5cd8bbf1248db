"""Analysis of a fade run, from its frames to its result."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.frame_times import switched_time, timed, untimed
from labrig.analyse.frames import part_frames, part_region, require_calibrated_camera
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import camera_curves, lamp_spectrum
from labrig.calibration import (
    CAMERA_KIND,
    LVF_KIND,
    CameraFile,
    Change,
    FadeFile,
    Warming,
    flicker_of,
)
from labrig.fit.spectrum import CurveError, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.number_format import plus_minus as plus_minus
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Disturbance, Misfit, ResultWarning
from labrig.optics import CameraResponse, Spectrum
from labrig.protocols.fade.analysis.change import FittedChange
from labrig.protocols.fade.analysis.fit import fit_change
from labrig.protocols.fade.protocol import SWITCHED, LampFrames
from labrig.protocols.fade.result import FadeResult, LampChange, SwitchedFrames, WarmingLight
from labrig.record import FrameRecord, FrameRole, RunRecord
from labrig.reduce import reduce_patches, sensor_layout
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
    steady_dn_per_s, dark_dn_per_s_sigma = (
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
        dark_dn_per_s_sigma,
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
        dark_dn_per_s_sigma=frames.dark_dn_per_s_sigma[columns],
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
    fits = [_warming_of(t_s, level / level_sigma, 1 / level_sigma, tau) for tau in TAU_S]
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


def _warming_of(
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


#: Step in nm of the wavelengths on which curves are integrated.
STEP_NM = 10.0
#: Times of the table in seconds, denser at first and the same in all runs, and the fraction of the
#: light at which the slowest band has reached its end.
TIMES_S: FloatArray = 7e-4 * np.arange(372.0) ** 1.5
GONE = 1e-4
#: Error of the camera's curves: those of another camera of its model.
CURVES = CurveError(added=0.02)
#: χ² per degree of freedom beyond which the lamp is no black-body emitter, and by how many of its
#: own standard deviations: 1.0 to 1.3 on 24 simulated benches.
BAD_CHI2, BAD_SIGMAS = 1.2, 4.0


def analyse(context: AnalysisContext) -> FadeResult:
    """Measure the lamp's turn-off, turn-on and warm-up transients.

    Raises
    ------
    DataError, FitError
        The photographs show no switched lamp.
    UsageError
        The rig file does not name the curves of lamp and camera.
    """
    protocol, camera = context.protocol, context.inputs[CAMERA_KIND]
    curves = camera_curves(context.rig, context.overrides.camera, context.inputs[LVF_KIND])
    lamp = lamp_spectrum(context.rig)
    frames = part_frames(context, LampFrames.FADE, LampFrames.RISE, LampFrames.STEADY)
    require_calibrated_camera(camera, context.run, frames)
    darks = part_frames(context, FrameRole.DARK)
    flicker = flicker_of(camera)
    edges = np.array(protocol.bands)
    nm = np.arange(edges[0], edges[-1] + STEP_NM / 2, STEP_NM)
    places, weights, errors = _places(context, frames, curves, lamp, nm)
    bands = _band_weights(edges, lamp, nm)
    changes: dict[str, LampChange] = {}
    tables: dict[str, Change] = {}
    fade: FittedChange | None = None
    for role in SWITCHED if protocol.rise else SWITCHED[:1]:
        switched = frames_after_switch(context.run, frames, darks, places, camera, role)
        channel_weights, weight_errors = weights, errors
        if protocol.through_lvf:
            # All channels of a place see the same band: one of them is enough.
            columns = brightest_channels(switched, len(curves.channels))
            switched = take_columns(switched, columns)
            channel_weights, weight_errors = weights[columns], errors[:, columns]
        change = fit_change(
            switched,
            channel_weights,
            weight_errors,
            nm,
            flicker,
            rises=role == LampFrames.RISE,
            fade=fade,
        )
        fade = change
        changes[role] = change.result(switched)
        tables[role] = _table(change, bands, nm)
    warm, warming_light = _fit_warming(context, darks, flicker)
    file = FadeFile(
        lamp=lamp.name,
        bands_nm=protocol.bands,
        fade=tables["fade"],
        rise=tables.get("rise"),
        warming=warm,
        source="measured with labrig, fade",
        run=context.run.name,
    )
    return FadeResult(
        calibration=file,
        fade=changes["fade"],
        rise=changes.get("rise"),
        warming=warming_light,
        warnings=tuple(_warnings(changes)),
    )


def _fit_warming(
    context: AnalysisContext, darks: Sequence[FrameRecord], flicker: float
) -> tuple[Warming, WarmingLight] | tuple[None, None]:
    frames = part_frames(context, LampFrames.WARMING)
    if not frames:
        return None, None
    card = part_region(context, context.protocol.card)
    return warming(context.run, frames, darks, card, context.inputs[CAMERA_KIND], flicker)


def _places(
    context: AnalysisContext,
    frames: Sequence[FrameRecord],
    curves: CameraResponse,
    lamp: Spectrum,
    nm: FloatArray,
) -> tuple[Mapping[str, Region], FloatArray, FloatArray]:
    """Return regions, and the steady lamp's weights at `nm` in their channels with their errors.

    A narrow band's weights hardly depend on the curves, and have no errors.
    """
    light, sensitivity = lamp.at(nm)[:, np.newaxis], curves.at(nm)
    channel_light = (light * sensitivity).T
    if not context.protocol.through_lvf:
        changes = camera_modes(curves, nm, CURVES)
        light_errors = np.array([(light * change).T for change in changes])
        card = {"card": part_region(context, context.protocol.card)}
        return card, _normalise(channel_light), _normalised_errors(channel_light, light_errors)
    lvf = context.inputs[LVF_KIND]
    if lvf is None or lvf.before_camera is None:
        raise DataError(
            "the fade through the variable filter needs its calibration: name it as optics.lvf in "
            "the rig file, or set through_lvf: false"
        )
    strip, layout = lvf.before_camera, sensor_layout(frames[0])
    transmission = lvf.lvf.at(strip.positions(layout.width, layout.height)).transmission(nm)
    through = transmission[:, np.newaxis, :] * channel_light
    weights = _normalise(through.reshape(-1, len(nm)))
    return strip.slices(), weights, np.empty((0, *weights.shape))


def _normalise(weights: FloatArray) -> FloatArray:
    result: FloatArray = weights / weights.sum(axis=1, keepdims=True)
    return result


def _normalised_errors(light: FloatArray, light_errors: FloatArray) -> FloatArray:
    """Return the errors of `_normalise(light)` by those of the light, (q, S, wavelengths)."""
    total_errors = light_errors.sum(axis=2, keepdims=True)
    result: FloatArray = (light_errors - _normalise(light) * total_errors) / light.sum(
        axis=1, keepdims=True
    )
    return result


def _band_weights(edges_nm: FloatArray, lamp: Spectrum, nm: FloatArray) -> FloatArray:
    """Return the lamp's light in each band, (bands, wavelengths); uniform where it has none."""
    middles = (edges_nm[1:] + edges_nm[:-1]) / 2
    inside = (nm >= edges_nm[:-1, np.newaxis]) & (nm <= edges_nm[1:, np.newaxis])
    for row, middle in enumerate(middles):
        if not inside[row].any():
            inside[row, np.argmin(np.abs(nm - middle))] = True
    uniform = inside.astype(np.float64)
    lamp_light = uniform * np.maximum(lamp.at(nm), 0.0)
    return _normalise(np.where(lamp_light.sum(axis=1, keepdims=True) > 0, lamp_light, uniform))


def _table(change: FittedChange, bands: FloatArray, nm: FloatArray) -> Change:
    fraction, sigma = change.in_bands(bands, nm, TIMES_S)
    remaining = 1 - fraction if change.rises else fraction
    ended = np.flatnonzero((remaining < GONE).all(axis=1))
    rows = slice(None if not len(ended) else int(ended[0]) + 1)
    t_s, fraction, sigma = TIMES_S[rows], fraction[rows], sigma[rows]
    first = 0.0 if change.rises else 1.0
    fraction[0], sigma[0] = first, 0.0
    return Change(
        t_s=tuple(_rounded(value) for value in t_s),
        fraction=tuple(tuple(_rounded(value) for value in row) for row in fraction),
        sigma=tuple(tuple(_rounded(value) for value in row) for row in sigma),
    )


def _rounded(value: float) -> float:
    return float(f"{value:.5g}")


def _warnings(changes: Mapping[str, LampChange]) -> Iterator[ResultWarning]:
    for role, change in changes.items():
        if change.best.reduced_chi2 > BAD_CHI2 + BAD_SIGMAS * np.sqrt(2 / change.best.dof):
            yield Misfit(
                "lamp-not-glowing-body",
                "the {role} is not that of a glowing body (χ² {reduced_chi2:.1f} a degree of "
                "freedom): is it a halogen lamp, and are its spectrum and the camera's curves "
                "those of this bench?",
                role=role,
                reduced_chi2=change.best.reduced_chi2,
            )
        exponent, sigma = change.exponent.value, change.exponent.sigma
        if abs(exponent - 1) > max(0.1, 4 * sigma):
            yield Misfit(
                "lamp-exponent",
                "the {role} follows the wavelength with an exponent of {exponent.plus_minus}, a "
                "glowing body has 1: see optics.lamp and optics.camera in the rig file",
                role=role,
                exponent=change.exponent,
            )
        if clipped := change.frames.clipped:
            yield Disturbance(
                "frames-clipped",
                "{clipped} photographs of the {role} clip and are left out; lower camera.iso",
                clipped=clipped,
                role=role,
            )
