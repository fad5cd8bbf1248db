"""From the frames of a run to one series for each patch of the sample, each file read once."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.optics import CameraModel
from labrig.reduce.dark import DarkModel, fit_dark
from labrig.reduce.glare import FRAME_TILES, frame_series, subtract_glare
from labrig.reduce.hot_pixels import HotPixels, hot_pixels_of
from labrig.reduce.measured_frames import (
    MeasuredFrame,
    RegionMeasurement,
    SeriesFrame,
    cut_off_levels,
    levels,
    measure_frames,
    pixels,
    shared_sigmas,
    strips,
)
from labrig.reduce.pair_noise import (
    PatchFrames,
    PatchNoise,
    PatchPairs,
    SensorNoise,
    paired_dark_sigma,
    paired_noise,
    rows_of_units,
)
from labrig.reduce.plane_noise import Floats
from labrig.results import Series, add_flag, is_usable


def apply_calibration(
    series: Series, camera: CameraModel, region: Region, width: int, height: int
) -> Series:
    """Correct the series of a region by the camera's calibration.

    The values are in DN/s of the first row's settings on the axis of the lens. Uncertainties of the
    calibration factors are not in `sigma`: such errors are common to all frames of a setting, and
    cancel where there is only one.

    Parameters
    ----------
    series
        Series of the region in DN/s.
    camera
        Calibration of the camera.
    region
        The region in fractions of the frame.
    width, height
        Size of the frame in pixels.

    Raises
    ------
    DataError
        The calibration is of another sensor or aperture.
    """
    if series.channels != camera.channels:
        raise DataError(
            f"calibration of another camera: expected frames with the channels "
            f"{', '.join(camera.channels)}, got {', '.join(series.channels)}"
        )
    settings = [
        (float(iso), None if np.isnan(f_number) else float(f_number))
        for iso, f_number in zip(series.iso, series.f_number, strict=True)
    ]
    reference_gain, _ = camera.scale(*settings[0])
    gain = {
        setting: camera.flat(setting[1], region, width, height)
        * camera.scale(*setting)[0]
        / reference_gain
        for setting in set(settings)
    }
    actual_s = np.array([camera.exposure_s(nominal_s)[0] for nominal_s in series.exposure_s])
    per_row = (actual_s / series.exposure_s)[:, None] * np.array(
        [gain[setting] for setting in settings]
    )
    # As the offset acts on a fit, most where weights are highest.
    weights = 1 / np.square(series.sigma)
    return replace(
        series,
        exposure_s=actual_s,
        values=series.values / per_row,
        sigma=series.sigma / per_row,
        dark_sigma=series.dark_sigma / np.average(per_row, axis=0, weights=weights),
    )


#: Fraction by which the dark current changes when the sensor is two degrees warmer than in the dark
#: frames: silicon doubles it every 6 °C or so. Dark frames are taken once, an hour or two before
#: the decay, and 20 min of warming up leave a camera a degree or two to go.
TWO_DEGREES = 2 ** (2 / 6) - 1
#: Multiple of the smallest patch's pixels up to which patches are taken together for their noise.
ALIKE = 4.0
#: Multiple of the read noise up to which a mean is too large where noise below black is cut off.
NEAR_BLACK = 3.0
#: Largest correlation of the errors of different channels.
MAX_COMMON = 0.99


@dataclass(frozen=True, eq=False)
class _PatchDark:
    """Dark level of a patch at one ISO.

    Attributes
    ----------
    kind
        Width, height and channels of the dark frames.
    model
        Dark level over exposure time.
    frames
        The patch in the dark frames.
    is_cut_off
        Whether noise below black is cut off in each of them.
    cut_off
        What the level is lowered by for that in DN, shape (C,).
    read_dn
        Read noise in DN by which it is; 0 if none is cut off.
    """

    kind: tuple[int, int, tuple[str, ...]]
    model: DarkModel
    frames: PatchFrames
    is_cut_off: bool
    cut_off: Floats
    read_dn: float


def reduce_series(
    frames: Sequence[SeriesFrame],
    region: Region,
    darks: Sequence[SeriesFrame] = (),
    background: Region | None = None,
    name: str = "",
) -> Series:
    """Reduce frames to the time series of one patch.

    Parameters
    ----------
    frames
        Light frames; those of one unit have one ISO and one f-number.
    region
        Region of the patch as (x, y, width, height) in fractions of the frame.
    darks
        Dark frames at the same ISO, as for `reduce_patches`.
    background
        Dark region of the light frames, whose level is subtracted instead of the dark frames'.
    name
        Name of the patch in the series.

    Returns
    -------
    Series
        Signal in DN/s with its standard uncertainty, one row for each frame in the given order.

    Raises
    ------
    DataError
        ISO or f-number differ within a unit, an exposure time is not above 0 s, or no dark frames
        match.
    FrameError, UsageError
        A frame cannot be read, or the region leaves it.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import SeriesFrame, reduce_series
    >>> run = labrig.read_run("runs/decay")
    >>> darks = [SeriesFrame(dark.path, 0.0, dark.exposure_s) for dark in run.frames("dark")]
    >>> glow = run.frames("decay")[:3]
    >>> frames = [
    ...     SeriesFrame(frame.path, frame.start_time - glow[0].start_time, frame.exposure_s)
    ...     for frame in glow
    ... ]
    >>> series = reduce_series(frames, (0.25, 0.25, 0.5, 0.5), darks, name="paint")
    >>> green = series.channels.index("G")
    >>> [f"{value:.0f} DN/s" for value in series.values[:, green]]
    ['8894 DN/s', '4806 DN/s', '3319 DN/s']
    """
    return reduce_patches(frames, {name: region}, darks, background)[name]


def reduce_patches(
    frames: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    darks: Sequence[SeriesFrame] = (),
    background: Region | None = None,
    camera: CameraModel | None = None,
) -> dict[str, Series]:
    """Reduce frames to the time series of each patch.

    Frames in which a patch is clipped (`is_clipped`) are flagged, not dropped. The standard
    uncertainty comes from pairs of successive frames of a unit, and of dark frames of one exposure
    time; where a patch has too few pairs, from those of all patches together, or from each frame
    alone.

    Parameters
    ----------
    frames
        Light frames; those of one unit have one ISO and one f-number.
    patches
        Region of each patch by its name, as (x, y, width, height) in fractions of the frame.
    darks
        Dark frames at the same ISO, best at the shortest and the longest exposure and two or more
        of the longest, whose hot pixels are then left out. Their level is subtracted.
    background
        Dark region of the light frames, whose level is subtracted instead of the dark frames'.
    camera
        Calibration by which actual exposure times, vignetting, gains of the settings and veiling
        glare are corrected; None leaves the values as they are. A background has the same glare as
        the patches.

    Returns
    -------
    dict of str to Series
        Signal of each patch in DN/s with its standard uncertainty, one row for each frame in the
        given order.

    Raises
    ------
    DataError
        ISO or f-number differ within a unit, an exposure time is not above 0 s, no dark frames
        match, or the calibration is of another camera or aperture.
    FrameError, UsageError
        A frame cannot be read, or a region leaves it.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import SeriesFrame, reduce_patches
    >>> run = labrig.read_run("runs/decay")
    >>> darks = [SeriesFrame(dark.path, 0.0, dark.exposure_s) for dark in run.frames("dark")]
    >>> first = run.frames("decay")[0]
    >>> frames = [SeriesFrame(first.path, 1.06, first.exposure_s)]
    >>> halves = {"left": (0.25, 0.25, 0.25, 0.5), "right": (0.5, 0.25, 0.25, 0.5)}
    >>> for name, series in reduce_patches(frames, halves, darks).items():
    ...     print(name, [f"{value:.2g}" for value in series.values[0]], series.flag)
    left ['1.1e+03', '8.9e+03', '5.1e+03'] ('',)
    right ['1.1e+03', '8.9e+03', '5.1e+03'] ('',)
    """
    if not frames or not patches:
        raise DataError(f"expected frames and patches, got {len(frames)} and {len(patches)}")
    glare = None if camera is None or background is not None else camera.glare
    if glare is not None:
        patches = {**patches, **FRAME_TILES}
    hot = hot_pixels_of(darks)
    dark = {} if background else _patch_darks(darks, patches, hot)
    measured = measure_frames(frames, patches, background, hot)
    _check_settings(measured)
    found = {name: _patch_levels(name, measured, dark) for name in patches}
    together = _noise_together(list(found.values()), measured)
    series = {name: _patch_series(patch, measured, together) for name, patch in found.items()}
    if camera is None:
        return series
    calibrated = {
        name: apply_calibration(patch_series, camera, patches[name], *_frame_size(measured[0]))
        for name, patch_series in series.items()
    }
    if glare is None:
        return calibrated
    frame = frame_series([calibrated.pop(name) for name in FRAME_TILES])
    return {
        name: subtract_glare(patch_series, frame, glare)
        for name, patch_series in calibrated.items()
    }


def _patch_darks(
    darks: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    hot: HotPixels | None,
) -> dict[tuple[str, float], _PatchDark]:
    """Return the dark level by patch and ISO."""
    by_iso: dict[float, list[MeasuredFrame]] = defaultdict(list)
    for entry in measure_frames(darks, patches, None, hot):
        by_iso[_setting_key(entry.iso)].append(entry)
    return {
        (name, iso): _patch_dark(
            [entry.frame.exposure_s for entry in measured], _views(name, measured)
        )
        for iso, measured in by_iso.items()
        for name in patches
    }


def _patch_dark(exposures_s: Sequence[float], views: Sequence[RegionMeasurement]) -> _PatchDark:
    exposure_s = np.array(exposures_s)
    level, sigma = levels(views)
    light = level - fit_dark(exposure_s, level, sigma).base
    frames = PatchFrames(exposure_s, strips(views), light, sigma, pixels(views))
    frames = replace(frames, sigma=np.hypot(paired_dark_sigma(frames), shared_sigmas(views)))
    return _PatchDark(
        views[0].kind,
        fit_dark(exposure_s, level, frames.sigma),
        frames,
        all(view.is_cut_off for view in views),
        cut_off_levels(views).mean(axis=0),
        max(stats.read_dn or 0.0 for view in views for stats in view.measured.channels.values()),
    )


@dataclass(frozen=True, eq=False)
class _PatchLevels:
    """Levels of a patch in n frames, before their noise is known.

    Attributes
    ----------
    name
        Name of the patch.
    views
        The patch in each frame.
    flags
        Flags of each frame.
    frames
        The patch above zero exposure, or above its background.
    dark, dark_sigma
        Level to subtract and its standard uncertainty in DN, shape (n, C).
    drift
        Part of `dark_sigma` by a sensor that warms, shape (n, C).
    darks
        The patch in the dark frames at the ISO of each unit, where there are any.
    cut_off
        What the correction for noise cut off below black adds to the patch above its dark level in
        DN, shape (n, C).
    untold
        Whether the patch is within the noise of black in a frame that does not tell this noise,
        though the camera cuts it off: its mean is not corrected, shape (n,).
    """

    name: str
    views: Sequence[RegionMeasurement]
    flags: tuple[str, ...]
    frames: PatchFrames
    dark: Floats
    dark_sigma: Floats
    drift: Floats
    darks: Mapping[str, PatchFrames]
    cut_off: Floats
    untold: npt.NDArray[np.bool_]

    @property
    def usable(self) -> npt.NDArray[np.bool_]:
        """Whether each frame can be in a pair."""
        return np.array([is_usable(flag) for flag in self.flags])


def _patch_levels(
    name: str, measured: Sequence[MeasuredFrame], darks: Mapping[tuple[str, float], _PatchDark]
) -> _PatchLevels:
    exposure_s = np.array([entry.frame.exposure_s for entry in measured])
    views = _views(name, measured)
    level, sigma = levels(views)
    dark, dark_sigma = np.zeros_like(level), np.full_like(level, np.nan)
    drift = np.zeros_like(level)
    unexposed = np.zeros_like(level)
    dark_of_unit: dict[str, PatchFrames] = {}
    cut_off = -cut_off_levels(views)
    untold = np.zeros(len(views), np.bool_)
    backgrounds = _backgrounds(measured)
    if backgrounds:
        dark = unexposed = levels(backgrounds)[0]
        dark_sigma = np.zeros_like(level)
        cut_off += cut_off_levels(backgrounds)
    elif darks:
        for row, (entry, view) in enumerate(zip(measured, views, strict=True)):
            patch_dark = darks.get((name, _setting_key(entry.iso)))
            if patch_dark is None or patch_dark.kind != view.kind:
                raise DataError(
                    f"{entry.frame.path}: expected dark frames at ISO {entry.iso:g} as this frame, "
                    "of the same sensor, got none; take some, or name a background region"
                )
            if view.is_cut_off and not patch_dark.is_cut_off:
                raise DataError(
                    f"{entry.frame.path}: the camera cuts off noise below black here, and the dark "
                    "frames have no noise that shows their level: it subtracts more than its black "
                    "level, or they are of another camera; raise its black level (offset), or take "
                    "the dark frames again"
                )
            dark[row], model_sigma = patch_dark.model.dark_level(entry.frame.exposure_s)
            unexposed[row] = patch_dark.model.base
            cut_off[row] += patch_dark.cut_off
            near_black = level[row] - dark[row] < NEAR_BLACK * patch_dark.read_dn
            untold[row] = patch_dark.is_cut_off and not view.is_cut_off and near_black.any()
            drift[row] = TWO_DEGREES * np.abs(patch_dark.model.current(entry.frame.exposure_s))
            dark_sigma[row] = np.hypot(model_sigma, drift[row])
            dark_of_unit[entry.frame.unit] = patch_dark.frames
    return _PatchLevels(
        name,
        views,
        tuple(_flag(entry, name) for entry in measured),
        PatchFrames(exposure_s, strips(views), level - unexposed, sigma, pixels(views)),
        dark,
        dark_sigma,
        drift,
        dark_of_unit,
        cut_off,
        untold,
    )


def _noise_together(
    patches: Sequence[_PatchLevels], measured: Sequence[MeasuredFrame]
) -> dict[str, SensorNoise | None]:
    """Return the noise of the pixels for each unit, by units of one ISO.

    It is that of the smallest patches: larger ones, such as the whole frame, may have structure
    that changes from frame to frame.
    """
    size = [patch.frames.pixels.sum() for patch in patches]
    small = [patch for patch, each in zip(patches, size, strict=True) if each <= ALIKE * min(size)]
    t_s = np.array([entry.frame.t_s for entry in measured])
    rows = rows_of_units([entry.frame.unit for entry in measured])
    units_of: dict[float, list[str]] = defaultdict(list)
    for unit, (first, *_) in rows.items():
        units_of[_setting_key(measured[first].iso)].append(unit)
    together: dict[str, SensorNoise | None] = {}
    for units in units_of.values():
        pairs = [
            PatchPairs.of_unit(
                patch.frames.take(rows[unit]), t_s[rows[unit]], patch.usable[rows[unit]]
            )
            for patch in small
            for unit in units
        ]
        pairs += [
            PatchPairs.of_like_exposure(patch.darks[units[0]])
            for patch in small
            if units[0] in patch.darks
        ]
        together |= dict.fromkeys(units, SensorNoise.of_patches(pairs))
    return together


def _patch_series(
    patch: _PatchLevels,
    measured: Sequence[MeasuredFrame],
    together: Mapping[str, SensorNoise | None],
) -> Series:
    exposure_s = patch.frames.exposure_s
    t_s = np.array([entry.frame.t_s for entry in measured])
    unit = tuple(entry.frame.unit for entry in measured)

    def noise(frames: PatchFrames) -> PatchNoise:
        return paired_noise(frames, t_s, unit, patch.usable, patch.darks, together)

    patch_noise = noise(patch.frames)
    sigma = np.hypot(patch_noise.sigma, shared_sigmas(patch.views))
    if backgrounds := _backgrounds(measured):
        _, alone = levels(backgrounds)
        beside = replace(
            patch.frames,
            deviations=strips(backgrounds),
            light=np.zeros_like(alone),
            sigma=alone,
            pixels=pixels(backgrounds),
        )
        sigma = np.hypot(sigma, noise(beside).sigma)
    per_second = exposure_s[:, np.newaxis]
    sigma = sigma / per_second
    # As the offset acts on a fit, most where weights are highest.
    weights = 1 / np.square(sigma)
    dark_sigma = np.average(patch.dark_sigma / per_second, axis=0, weights=weights)
    drift_sigma = np.average(patch.drift / per_second, axis=0, weights=weights)
    return Series(
        t_s=t_s,
        exposure_s=exposure_s,
        values=(levels(patch.views)[0] - patch.dark) / per_second,
        sigma=sigma,
        dark_sigma=dark_sigma,
        channels=tuple(patch.views[0].measured.channels),
        iso=np.array([entry.iso for entry in measured], dtype=np.float64),
        f_number=np.array([entry.f_number for entry in measured], dtype=np.float64),
        frame=tuple(entry.frame.path.name for entry in measured),
        unit=unit,
        flag=patch.flags,
        region=patch.name,
        correlation=patch_noise.correlation,
        dark_correlation=_dark_correlation(dark_sigma, drift_sigma, patch_noise.correlation),
        warnings=_cut_off_warning(patch, patch.cut_off / per_second, sigma),
    )


def _cut_off_warning(
    patch: _PatchLevels, added: Floats, sigma: Floats
) -> tuple[ResultWarning, ...]:
    """Return a warning about the correction for noise cut off below black; empty without one.

    `added` is what it adds to the values, in their unit as `sigma`, shape (n, C).
    """
    usable = patch.usable
    if not patch.cut_off[usable].any():
        return ()
    if patch.untold.any():
        return (
            Disturbance(
                "black-cut-off",
                "the camera subtracts black and cuts off noise below it; {uncorrected} of {frames} "
                "frames are near black and too uneven to determine this noise, so that their "
                "values are too large by up to 0.4 of it: leave these frames out, photograph an "
                "even surface, or let the camera keep its black level (offset, brightness)",
                uncorrected=int(patch.untold.sum()),
                frames=len(usable),
            ),
        )
    sigmas = (np.abs(added) / sigma)[usable].max(axis=1)
    if sigmas.max() <= 1:
        return (
            Disturbance(
                "black-cut-off",
                "the camera subtracts black and cuts off noise below it, for which values are "
                "corrected by less than their σ",
                most_sigmas=sigmas.max(),
            ),
        )
    return (
        Disturbance(
            "black-cut-off",
            "the camera subtracts black and cuts off noise below it, for which values are "
            "corrected by up to {most_dn_per_s:.2g} DN/s, in {beyond_sigma} of {frames} frames by "
            "more than their σ: faint values rest on it; if the camera can keep its black level "
            "(offset, brightness), let it",
            most_dn_per_s=np.abs(added[usable]).max(),
            beyond_sigma=int(np.count_nonzero(sigmas > 1)),
            frames=len(sigmas),
            most_sigmas=sigmas.max(),
        ),
    )


def _backgrounds(measured: Sequence[MeasuredFrame]) -> list[RegionMeasurement]:
    return [entry.background for entry in measured if entry.background is not None]


def _dark_correlation(sigma: Floats, drift: Floats, noise: Floats) -> Floats | None:
    """Return the correlation (C, C) of the dark level's errors.

    Errors by the sensor's warming are common to all channels; those by noise correlate as the
    noise.
    """
    if not (sigma > 0).all():
        return None
    model_fraction = np.sqrt(np.maximum(np.square(sigma) - np.square(drift), 0.0)) / sigma
    drift_fraction = drift / sigma
    correlation = noise * np.outer(model_fraction, model_fraction) + np.outer(
        drift_fraction, drift_fraction
    )
    # A dark level known without noise would make the errors all one.
    return np.where(np.eye(len(sigma), dtype=np.bool_), 1.0, MAX_COMMON * correlation)


def _frame_size(entry: MeasuredFrame) -> tuple[int, int]:
    """Return width and height of a frame in pixels."""
    width, height, _ = next(iter(entry.patches.values())).kind
    return width, height


def _views(name: str, measured: Sequence[MeasuredFrame]) -> list[RegionMeasurement]:
    return [entry.patches[name] for entry in measured]


def _flag(entry: MeasuredFrame, name: str) -> str:
    views = [entry.patches[name], *([entry.background] if entry.background else [])]
    clipped = any(view.measured.clipped for view in views)
    return add_flag(entry.frame.flag, "clipped") if clipped else entry.frame.flag


def _check_settings(measured: Sequence[MeasuredFrame]) -> None:
    """Refuse frames of several gains or apertures in one unit: their DN/s are not comparable."""
    for unit in {entry.frame.unit for entry in measured}:
        for setting, values in (
            ("ISO", {_setting_key(entry.iso) for entry in measured if entry.frame.unit == unit}),
            (
                "f-number",
                {_setting_key(entry.f_number) for entry in measured if entry.frame.unit == unit},
            ),
        ):
            if len(values) > 1:
                raise DataError(
                    f"expected one {setting} in unit '{unit}', got {sorted(values)}; DN/s of "
                    "different settings do not compare: reduce them apart"
                )


def _setting_key(number: float) -> float:
    """Return `number`, or −1 for NaN, which as a key would not equal itself."""
    return -1.0 if np.isnan(number) else number
