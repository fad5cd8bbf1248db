"""Analysis of a blank, from its frames to its result."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from labrig.analyse.frame_times import timing_warnings
from labrig.analyse.frames import (
    intact_frames,
    part_frames,
    part_region,
    require_calibrated_camera,
)
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CAMERA_KIND, BlankFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.protocols.blank.protocol import BLANK_FRAMES
from labrig.protocols.blank.result import BlankResult, StrayLight
from labrig.reduce import (
    FrameMeasurement,
    fit_dark,
    hot_pixels_of,
    measure_region,
    reduce_patches,
)
from labrig.results import Series

#: Fraction of the frames, the latest ones, that determine the constant level.
LATE = 1 / 2
#: Fewest frames that determine the constant level.
FEWEST = 4


def stray_light(series: Series, sigmas: float, least_dn: float) -> StrayLight:
    """Measure the stray light in a series.

    Parameters
    ----------
    series
        Series of a region without glow, in DN/s.
    sigmas, least_dn
        A frame is clean if it exceeds the constant level by less than `sigmas` of its own σ, or by
        less than `least_dn` in DN.

    Raises
    ------
    DataError
        There are too few frames.
    """
    middle_s = series.t_s + series.exposure_s / 2
    order = np.argsort(middle_s, kind="stable")
    # A clipped frame is a lower limit: it stays, and is not clean.
    late = order[int(len(order) * (1 - LATE)) :]
    late = late[series.usable[late]]
    if len(late) < FEWEST:
        raise DataError(
            f"expected {FEWEST} frames or more in the later half of a blank, got {len(late)}; "
            "record it for longer"
        )
    constant, own_sigma = _weighted_mean(series.values[late], series.sigma[late])
    half = len(late) // 2
    early_level, early_sigma = _weighted_mean(series.values[late[:half]], series.sigma[late[:half]])
    last_level, last_sigma = _weighted_mean(series.values[late[half:]], series.sigma[late[half:]])
    fades = bool(((early_level - last_level) > sigmas * np.hypot(early_sigma, last_sigma)).any())
    rate = series.values[order] - constant
    sigma = np.hypot(series.sigma[order], own_sigma)
    counts = rate * series.exposure_s[order][:, np.newaxis]
    unclean = ((rate > sigmas * sigma) & (counts > least_dn)).any(axis=1)
    unclean |= ~series.usable[order]
    start_s = series.t_s[order]
    first_clean = int(np.flatnonzero(unclean)[-1]) + 1 if unclean.any() else 0
    clean_s = None if fades or first_clean >= len(start_s) else float(start_s[first_clean])
    dark = np.where(np.isnan(series.dark_sigma), 0.0, series.dark_sigma)
    return StrayLight(
        start_s, middle_s[order], rate, sigma, constant, np.hypot(own_sigma, dark), fades,
        unclean, clean_s,
    )  # fmt: skip


def ambient(darks: Sequence[FrameMeasurement]) -> tuple[FloatArray, FloatArray]:
    """Measure the ambient light in dark frames.

    Dark current is the same in all channels, light is not: the excess of a channel over the one
    with the smallest signal is light. It is a lower limit.

    Parameters
    ----------
    darks
        Measured dark frames.

    Returns
    -------
    tuple of ndarray
        Light beyond dark current and its standard uncertainty in DN/s, shape (channels,) each.
    """
    exposure_s = np.array([dark.exposure_s or 0.0 for dark in darks])
    pairs = [[(c.mean, c.sigma) for c in dark.channels.values()] for dark in darks]
    level, sigma = np.moveaxis(np.array(pairs), 2, 0)
    model = fit_dark(exposure_s, level, sigma)
    rate, rate_sigma = model.rate_per_s, np.sqrt(model.covariance[:, 1, 1])
    least = int(np.argmin(rate))
    excess_sigma = np.hypot(rate_sigma, rate_sigma[least])
    excess_sigma[least] = rate_sigma[least]
    return rate - rate[least], excess_sigma


def _weighted_mean(values: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the weighted mean of rows, and its σ by their own σ and by their scatter."""
    weights = 1 / np.square(sigma)
    mean = np.average(values, axis=0, weights=weights)
    misfit = (weights * np.square(values - mean)).sum(axis=0) / max(len(values) - 1, 1)
    return mean, np.sqrt(np.maximum(misfit, 1.0) / weights.sum(axis=0))


def analyse(context: AnalysisContext) -> BlankResult:
    """Measure the light after lamp off where nothing glows.

    Raises
    ------
    DataError
        No sequence is complete, or a frame is missing or was changed.
    """
    protocol, run, camera = context.protocol, context.run, context.inputs[CAMERA_KIND]
    region = part_region(context, protocol.region)
    frames = intact_frames(run, context.overrides, BLANK_FRAMES)
    require_calibrated_camera(camera, run, part_frames(context, BLANK_FRAMES))
    series = reduce_patches(frames.decay, {"blank": region}, frames.dark, camera=camera)["blank"]
    # Hot pixels are of one colour: left in, they look like light.
    hot = hot_pixels_of(frames.dark)
    darks = [
        replace(measured, exposure_s=frame.exposure_s)
        for frame, measured in zip(
            frames.dark, measure_region(frames.dark, region, hot), strict=True
        )
    ]
    least_dn = protocol.clean.fraction * darks[0].range_dn
    light = stray_light(series, protocol.clean.sigmas, least_dn)
    leak, leak_sigma = ambient(darks)
    rows = _rows_until_clean(light)
    file = BlankFile(
        iso=protocol.camera.iso,
        f_number=protocol.camera.f_number,
        channels=series.channels,
        t_s=tuple(light.t_s[rows].tolist()),
        rate_dn_per_s=tuple(tuple(row) for row in light.rate[rows].tolist()),
        sigma_dn_per_s=tuple(tuple(row) for row in light.sigma[rows].tolist()),
        constant_dn_per_s=tuple(light.constant.tolist()),
        constant_dn_per_s_sigma=tuple(light.constant_sigma.tolist()),
        ambient_dn_per_s=tuple(leak.tolist()),
        ambient_dn_per_s_sigma=tuple(leak_sigma.tolist()),
        first_clean_s=light.first_clean_s,
        source="measured with labrig, blank",
        run=run.name,
    )
    return BlankResult(
        calibration=file,
        stray_light=light,
        warnings=(*timing_warnings(run, "blank"), *series.warnings, *_warnings(file, light)),
    )


def _rows_until_clean(light: StrayLight) -> "np.ndarray[tuple[int], np.dtype[np.intp]]":
    """Return the rows up to the first clean frame, each time once."""
    last = len(light.t_s)
    if light.first_clean_s is not None:
        last = int(np.searchsorted(light.start_s, light.first_clean_s)) + 1
    _, rows = np.unique(light.t_s[:last], return_index=True)
    return rows


def _warnings(file: BlankFile, light: StrayLight) -> Iterator[ResultWarning]:
    if light.fades:
        yield Disturbance(
            "blank-still-fades",
            "the blank still gets darker at its end: the lamp glows on for long (use a shield), or "
            "the card itself glows (take another); record it for longer",
        )
    yield from file.leaks()
