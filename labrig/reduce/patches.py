"""From the frames of a run to one series for each patch of the sample, each file read once."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.errors import DataError
from labrig.reduce.channels import FrameMeasurement, measure
from labrig.reduce.dark import HOT_FRAMES, SAME_EXPOSURE, DarkModel, fit_dark, hot_pixels
from labrig.reduce.noise import Floats
from labrig.reduce.pairs import paired_sigma, strip_deviations
from labrig.reduce.planes import PixelMask
from labrig.reduce.raw import RawFrame, read_raw
from labrig.reduce.series import Series, add_flag, is_usable
from labrig.region import Region

#: Share of a patch's pixels that may be saturated before its mean is too small.
CLIPPED_SHARE = 0.001
#: Share by which the dark current changes when the sensor is one degree warmer than in the dark
#: frames: silicon doubles it every 6 °C or so. Dark frames are taken once, an hour or two before.
ONE_DEGREE = 2 ** (1 / 6) - 1
#: Dark frames held in memory at once, to look for hot pixels.
_DARKS_FOR_HOT = 5
#: Frames in memory at once otherwise; only one is ever being decoded.
_FRAMES_AT_ONCE = 2


@dataclass(frozen=True)
class SeriesFrame:
    """A frame on disk and its *measured* times.

    Parameters
    ----------
    t_s, exposure_s
        Start of the exposure (after lamp off) and its length. Of a dark frame, `t_s` is not used.
    iso, f_number
        None: as the file's EXIF says.
    unit, flag
        Unit of the run, and flags it already has.
    """

    path: Path
    t_s: float
    exposure_s: float
    iso: float | None = None
    f_number: float | None = None
    unit: str = ""
    flag: str = ""


@dataclass(frozen=True, eq=False)
class _View:
    """A region of a frame: what is in it, and how its strips (C, strips) deviate from its mean."""

    measured: FrameMeasurement
    strips: Floats


@dataclass(frozen=True)
class _Shot:
    """A frame, seen in every patch and in the background, if there is one."""

    frame: SeriesFrame
    patches: Mapping[str, _View]
    background: _View | None

    @property
    def iso(self) -> float:
        """NaN where neither the run nor the file says."""
        return _first(self.frame.iso, *(view.measured.iso for view in self.patches.values()))

    @property
    def f_number(self) -> float:
        """NaN where neither the run nor the file says."""
        views = self.patches.values()
        return _first(self.frame.f_number, *(view.measured.f_number for view in views))


def reduce_series(
    frames: Sequence[SeriesFrame],
    region: Region,
    darks: Sequence[SeriesFrame] = (),
    background: Region | None = None,
    name: str = "",
) -> Series:
    """The series of one patch, called `name`; see `reduce_patches`."""
    return reduce_patches(frames, {name: region}, darks, background)[name]


def reduce_patches(
    frames: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    darks: Sequence[SeriesFrame] = (),
    background: Region | None = None,
) -> dict[str, Series]:
    """The series of each patch, in DN/s, with a row for every frame in the given order.

    Parameters
    ----------
    frames
        Light frames; those of one unit have one ISO and one f-number.
    patches
        Where each patch lies, by its name.
    darks
        Dark frames at the same ISO, best at the shortest and the longest exposure and two or
        more of the longest, whose hot pixels are then left out. Their level is subtracted.
    background
        A dark region of the frames themselves, whose level is subtracted instead.

    Frames with more than 0.1 % of a patch saturated are flagged `clipped`, not dropped. Sigma comes
    from pairs of successive frames of a unit, if there are enough, else from each frame alone.

    Raises
    ------
    DataError
        Frames of different ISO or f-number in one unit, no exposure, or no dark frames that match.
    FrameError, UsageError
        As `read_raw` and `measure`.
    """
    if not frames or not patches:
        raise DataError(f"expected frames and patches, got {len(frames)} and {len(patches)}")
    longest = _read_longest(darks)
    hot = hot_pixels(list(longest.values())) if longest else None
    models = {} if background else _dark_models(darks, patches, hot, longest)
    longest.clear()  # five frames of 42 MB that nobody needs any more
    shots = _shots(frames, patches, background, hot, {})
    _check_settings(shots)
    return {name: _patch_series(name, shots, models) for name in patches}


def _read_longest(darks: Sequence[SeriesFrame]) -> dict[Path, RawFrame]:
    """Some of the longest darks; none if they are too few to tell hot pixels."""
    longest_s = max((dark.exposure_s for dark in darks), default=0.0)
    longest = [dark for dark in darks if dark.exposure_s >= longest_s * (1 - SAME_EXPOSURE)]
    if len(longest) < HOT_FRAMES:
        return {}
    return {dark.path: read_raw(dark.path) for dark in longest[:_DARKS_FOR_HOT]}


def _shots(
    frames: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    background: Region | None,
    hot: PixelMask | None,
    read: Mapping[Path, RawFrame],
) -> list[_Shot]:
    """All `frames` in order; one is decoded, unless it is `read`, while another is measured."""

    def shot(frame: SeriesFrame) -> _Shot:
        raw = read.get(frame.path) or read_raw(frame.path)
        return _shot(frame, raw, patches, background, hot)

    with ThreadPoolExecutor(_FRAMES_AT_ONCE) as pool:
        return list(pool.map(shot, frames))


def _shot(
    frame: SeriesFrame,
    raw: RawFrame,
    patches: Mapping[str, Region],
    background: Region | None,
    hot: PixelMask | None,
) -> _Shot:
    if not frame.exposure_s > 0:
        raise DataError(f"{frame.path}: expected an exposure above 0 s, got {frame.exposure_s}")
    return _Shot(
        frame,
        {name: _view(raw, region, hot, frame.path) for name, region in patches.items()},
        _view(raw, background, hot, frame.path) if background else None,
    )


def _view(raw: RawFrame, region: Region, hot: PixelMask | None, path: Path) -> _View:
    try:
        return _View(measure(raw, region, hot), strip_deviations(raw, region, hot))
    except DataError as error:
        raise type(error)(f"{path}: {error}") from None


def _dark_models(
    darks: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    hot: PixelMask | None,
    read: Mapping[Path, RawFrame],
) -> dict[tuple[str, float], DarkModel]:
    """Dark level by patch and ISO."""
    by_iso: dict[float, list[_Shot]] = defaultdict(list)
    for shot in _shots(darks, patches, None, hot, read):
        by_iso[_key(shot.iso)].append(shot)
    return {
        (name, iso): fit_dark(
            np.array([shot.frame.exposure_s for shot in shots]),
            *_levels([shot.patches[name] for shot in shots]),
        )
        for iso, shots in by_iso.items()
        for name in patches
    }


def _patch_series(
    name: str, shots: Sequence[_Shot], models: Mapping[tuple[str, float], DarkModel]
) -> Series:
    exposure_s = np.array([shot.frame.exposure_s for shot in shots])
    t_s = np.array([shot.frame.t_s for shot in shots])
    unit = tuple(shot.frame.unit for shot in shots)
    flags = tuple(_flag(shot, name) for shot in shots)

    def noise(views: Sequence[_View], light: Floats, sigma: Floats) -> Floats:
        strips = np.stack([view.strips for view in views])
        usable = np.array([is_usable(flag) for flag in flags])
        return paired_sigma(strips, light, sigma, t_s, unit, usable)

    views = [shot.patches[name] for shot in shots]
    level, sigma = _levels(views)
    dark, dark_sigma = np.zeros_like(level), np.full_like(level, np.nan)
    backgrounds = [shot.background for shot in shots if shot.background is not None]
    if backgrounds:
        dark, dark_noise = _levels(backgrounds)
        dark_noise = noise(backgrounds, np.zeros_like(dark), dark_noise)
        dark_sigma = np.zeros_like(level)
    elif models:
        for row, shot in enumerate(shots):
            model = models.get((name, _key(shot.iso)))
            if model is None or len(model.base) != level.shape[1]:
                raise DataError(
                    f"{shot.frame.path}: expected dark frames at ISO {shot.iso:g} as this frame, "
                    "of the same sensor, got none; take some, or name a background region"
                )
            dark[row], of_model = model.dark_level(shot.frame.exposure_s)
            drift = ONE_DEGREE * np.abs(model.current(shot.frame.exposure_s))
            dark_sigma[row] = np.hypot(of_model, drift)
    sigma = noise(views, level - dark, sigma)
    if backgrounds:
        sigma = np.hypot(sigma, dark_noise)
    per_second = exposure_s[:, np.newaxis]
    sigma = sigma / per_second
    return Series(
        t_s=t_s,
        exposure_s=exposure_s,
        values=(level - dark) / per_second,
        sigma=sigma,
        # One number for all frames: as the offset acts on a fit, most where weights are highest.
        dark_sigma=np.average(dark_sigma / per_second, axis=0, weights=1 / np.square(sigma)),
        channels=tuple(views[0].measured.channels),
        iso=np.array([shot.iso for shot in shots]),
        f_number=np.array([shot.f_number for shot in shots]),
        frame=tuple(shot.frame.path.name for shot in shots),
        unit=unit,
        flag=flags,
        region=name,
    )


def _levels(views: Sequence[_View]) -> tuple[Floats, Floats]:
    """Means and what each frame by itself says of their sigma in DN, each of shape (n, C)."""
    kinds = {(view.measured.width, view.measured.height, *view.measured.channels) for view in views}
    if len(kinds) > 1:
        raise DataError(f"expected frames of one sensor and size, got {sorted(kinds)}")
    pairs = [[(c.mean, c.sigma) for c in view.measured.channels.values()] for view in views]
    mean, sigma = np.moveaxis(np.array(pairs), 2, 0)
    return mean, sigma


def _flag(shot: _Shot, name: str) -> str:
    views = [shot.patches[name], *([shot.background] if shot.background else [])]
    clipped = any(
        stats.saturated > CLIPPED_SHARE * stats.n
        for view in views
        for stats in view.measured.channels.values()
    )
    return add_flag(shot.frame.flag, "clipped") if clipped else shot.frame.flag


def _check_settings(shots: Sequence[_Shot]) -> None:
    """DN/s compare only at one gain and one aperture."""
    for unit in {shot.frame.unit for shot in shots}:
        for what, found in (
            ("ISO", {_key(shot.iso) for shot in shots if shot.frame.unit == unit}),
            ("f-number", {_key(shot.f_number) for shot in shots if shot.frame.unit == unit}),
        ):
            if len(found) > 1:
                raise DataError(
                    f"expected one {what} in unit '{unit}', got {sorted(found)}; DN/s of different "
                    "settings do not compare: reduce them apart"
                )


def _first(*numbers: float | None) -> float:
    return next((number for number in numbers if number is not None), np.nan)


def _key(number: float) -> float:
    """`number`, or −1 for NaN, which as a key would not equal itself."""
    return -1.0 if np.isnan(number) else number
