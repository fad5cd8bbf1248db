"""Views of a yarn: signal by angle, and the test."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.frame_times import untimed
from labrig.analyse.frames import part_frames, part_region, require_calibrated_camera
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CAMERA_KIND
from labrig.fit.angular import fit_dependence
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import Disturbance, ResultWarning, Unmeasured
from labrig.protocols.angular_fluorescence.analysis.channels import (
    chosen_channels,
    grouped,
    led_response,
    mixed_limit,
    reflected_at_most,
    reflected_signal,
)
from labrig.protocols.angular_fluorescence.protocol import AngularFrames, Pose
from labrig.protocols.angular_fluorescence.result import YarnViews
from labrig.reduce import reduce_series
from labrig.results import LEVEL, Series, is_usable

#: Least signal of a view over the median of all of them: another LED was lit, or none.
MIN_SIGNAL = 0.2
#: Least signal over its σ.
MIN_SIGMAS = 5.0


@dataclass(frozen=True, eq=False)
class View:
    """One view in all channels: LED on less LED off, in DN/s, shape (channels,) each."""

    pose: Pose
    channels: tuple[str, ...]
    value: FloatArray
    sigma: FloatArray


def yarn_views(context: AnalysisContext) -> tuple[tuple[YarnViews, ...], list[ResultWarning]]:
    """Return the views of each LED and direction with their tests, and warnings.

    Raises
    ------
    DataError
        Frames are damaged, or there are too few views of every direction.
    UsageError
        The channels cannot be chosen.
    """
    views, warnings = _views(context)
    protocol = context.protocol
    level = LEVEL / (len(protocol.leds) * len(protocol.directions))
    tested, refused = [], []
    for led in protocol.leds:
        for direction in protocol.directions:
            own = [v for v in views if (v.pose.led, v.pose.direction) == (led, direction)]
            lit, dark = _lit(own)
            warnings += dark
            try:
                tested.append(_tested(context, lit, led, direction, level))
            except DataError as error:
                under = f"{direction} under {led}"
                refused.append(
                    Unmeasured("views-untested", "{reason}", subject=under, reason=str(error))
                )
    if not tested:
        raise DataError("; ".join(map(str, refused)))
    return tuple(tested), [*warnings, *refused]


def _views(context: AnalysisContext) -> tuple[list[View], list[ResultWarning]]:
    """Return all complete views, and a warning about each group of others."""
    on, off = (_series(context, role) for role in AngularFrames)
    units_on, units_off = grouped(on.unit), grouped(off.unit)
    views, clipped, missing = [], [], []
    for pose in context.protocol.poses():
        if pose.unit not in units_on or pose.unit not in units_off:
            missing.append(pose.unit)
            continue
        rows = units_on[pose.unit]
        if not all(is_usable(on.flag[row]) for row in rows):
            clipped.append(pose.unit)
            continue
        bright, bright_sigma = _mean(on, rows)
        dark, dark_sigma = _mean(off, units_off[pose.unit])
        views.append(View(pose, on.channels, bright - dark, np.hypot(bright_sigma, dark_sigma)))
    warnings: list[ResultWarning] = []
    if missing:
        warnings.append(
            Unmeasured(
                "view-missing",
                "{missing} of {views} views are missing ({named}); the others are used (go on with "
                "labrig resume)",
                missing=len(missing),
                views=len(context.protocol.poses()),
                named=_named(missing),
            )
        )
    if clipped:
        warnings.append(
            Disturbance(
                "view-clipped",
                "{clipped} views clip ({named}) and are left out; lower camera.iso, or name the "
                "brightest angle first",
                clipped=len(clipped),
                named=_named(clipped),
            )
        )
    return views, warnings


def _series(context: AnalysisContext, role: AngularFrames) -> Series:
    frames = part_frames(context, role)
    require_calibrated_camera(context.inputs[CAMERA_KIND], context.run, frames)
    if not frames:
        raise DataError(
            f"{context.run.folder}: no view is complete; go on with: "
            f"labrig resume {context.run.folder}"
        )
    region = part_region(context, context.protocol.region)
    return reduce_series([untimed(frame) for frame in frames], region)


def _mean(series: Series, rows: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return the mean of some frames in DN/s and its σ, shape (channels,) each."""
    sigma = np.sqrt((series.sigma[rows] ** 2).sum(axis=0)) / len(rows)
    return series.values[rows].mean(axis=0), sigma


def _lit(views: Sequence[View]) -> tuple[list[View], list[ResultWarning]]:
    """Return the views in which the LED was lit, and a warning about the others."""
    if not views:
        return [], []
    total = np.array([view.value.sum() for view in views])
    sigma = np.array([np.sqrt((view.sigma**2).sum()) for view in views])
    is_lit = (total > MIN_SIGMAS * sigma) & (total > MIN_SIGNAL * np.median(total))
    dark = [view.pose.unit for view, lit in zip(views, is_lit, strict=True) if not lit]
    if not dark:
        return list(views), []
    warning = Unmeasured(
        "view-dark",
        "{dark} views are dark ({named}) and are left out: the LED did not light, or the yarn was "
        "not in the region",
        dark=len(dark),
        named=_named(dark),
    )
    return [view for view, lit in zip(views, is_lit, strict=True) if lit], [warning]


def _tested(
    context: AnalysisContext, views: Sequence[View], led: str, direction: str, level: float
) -> YarnViews:
    if not views:
        raise DataError("no view is lit and complete")
    channels = views[0].channels
    signal = np.mean([view.value for view in views], axis=0)
    response = led_response(context.rig, led, channels, context.overrides.camera)
    limits = reflected_at_most(signal, response)
    chosen = chosen_channels(context.protocol.channels, channels, "re-radiated", limits, response)
    angle_deg = np.array([view.pose.angle_deg for view in views], dtype=np.float64)
    values = np.array([view.value for view in views])
    reflected, reflected_sigma = reflected_signal(values, response, chosen)
    value = values[:, chosen].sum(axis=1) - reflected
    sigma = np.array([np.sqrt((view.sigma[chosen] ** 2).sum()) for view in views])
    return YarnViews(
        led=led,
        direction=direction,
        channels=tuple(channels[number] for number in chosen),
        reflected_at_most=mixed_limit(signal, limits, chosen),
        angle_deg=angle_deg,
        signal=value,
        signal_sigma=sigma,
        means=fit_dependence(angle_deg, value, sigma, level, reflected_sigma / value),
    )


def _named(units: Sequence[str], most: int = 3) -> str:
    more = f" and {len(units) - most} more" if len(units) > most else ""
    return ", ".join(units[:most]) + more
