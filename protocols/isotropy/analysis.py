"""Analysis of an isotropy run, from its frames to the glow at several angles."""

from collections.abc import Iterator, Mapping

import numpy as np

from labrig.analyse.frame_times import timing_warnings
from labrig.analyse.frames import intact_frames, require_calibrated_camera, without_stray_light
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import BLANK_KIND, CAMERA_KIND, flicker_of
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning
from labrig.protocols.isotropy.result import (
    PAPER_FLUCTUATION,
    AngularGlow,
    IsotropyResult,
    is_within_paper,
)
from labrig.reduce import reduce_patches
from labrig.results import Measured, Series

BEFORE, AFTER = "angle-before", "angle-after"


def analyse(context: AnalysisContext) -> IsotropyResult:
    """Measure the radiance at each angle relative to the straight view.

    Raises
    ------
    DataError
        A straight view or all others are missing, or frames are damaged.
    """
    protocol, run, camera = context.protocol, context.run, context.inputs[CAMERA_KIND]
    frames, stray = without_stray_light(
        intact_frames(run, context.overrides, protocol.role), context.inputs[BLANK_KIND]
    )
    require_calibrated_camera(camera, run, run.frames(protocol.role))
    regions = context.overrides.patches(protocol)
    series = reduce_patches(frames.decay, regions, frames.dark, camera=camera)
    flicker = flicker_of(camera)
    encloses_sample = protocol.patch == "around"
    angles_deg = {f"angle-{angle}": angle for angle in protocol.angles}
    patches = {
        name: _angular_glow(patch_series, angles_deg, flicker, encloses_sample)
        for name, patch_series in series.items()
    }
    return IsotropyResult(
        patches=patches,
        encloses_sample=encloses_sample,
        warnings=(
            *timing_warnings(run, protocol.role),
            *stray,
            *(
                warning.about(name if len(patches) > 1 else "")
                for name, glow in patches.items()
                for warning in (*series[name].warnings, *_warnings(glow))
            ),
        ),
    )


def _angular_glow(
    series: Series, angles_deg: Mapping[str, int], flicker: float, encloses_sample: bool
) -> AngularGlow:
    units = {view.unit[0]: view for view in series.by_unit()}
    if BEFORE not in units or AFTER not in units or not angles_deg.keys() & units.keys():
        raise DataError(
            "expected views at some angle between two straight ones, not all of them are "
            "complete: go on with labrig resume"
        )
    log_drift, drift_sigma = _log_ratio(units[AFTER], units[BEFORE], flicker)
    drift = float(np.exp(log_drift))
    views = []
    for number, (unit, view) in enumerate(units.items()):
        if unit not in angles_deg:
            continue
        log_ratio, sigma = _log_ratio(view, units[BEFORE], flicker)
        # What lamp and sample drifted by comes evenly between the two straight views.
        fraction = number / (len(units) - 1)
        log_ratio -= fraction * np.log(drift)
        sigma = np.hypot(sigma, np.hypot(fraction * drift_sigma, abs(drift - 1) / np.sqrt(12)))
        ratio = float(np.exp(log_ratio))
        if encloses_sample:
            ratio /= float(np.cos(np.radians(angles_deg[unit])))
        views.append((angles_deg[unit], ratio, ratio * sigma))
    angle_deg, ratios, sigmas = zip(*sorted(views), strict=True)
    return AngularGlow(
        np.array(angle_deg, dtype=np.intp),
        np.array(ratios),
        np.array(sigmas),
        Measured(drift, drift * drift_sigma),
    )


def _log_ratio(view: Series, straight: Series, flicker: float) -> tuple[float, float]:
    """Return the logarithm of a view over the straight one at the same times, and its σ."""
    best = int(np.argmax(np.mean(straight.values / straight.sigma, axis=0)))
    value, value_sigma = _usable(view, best)
    reference, reference_sigma = _usable(straight, best)
    if (value <= 0).any() or (reference <= 0).any() or len(value) == 0 or len(reference) < 2:
        raise DataError(
            f"{view.unit[0]}: expected a glow in every frame, got none above the noise; charge for "
            "longer, raise camera.iso or photograph earlier (first:)"
        )
    # A frame's own flicker, and that of all frames that it is held against.
    logs = np.log(value) - _interpolate_log(_middle_s(view), _middle_s(straight), np.log(reference))
    sigma = np.hypot(value_sigma / value, flicker)
    weight = 1 / sigma**2
    common = np.sqrt(np.mean((reference_sigma / reference) ** 2) + flicker**2) / np.sqrt(
        len(reference)
    )
    return float(weight @ logs / weight.sum()), float(np.hypot(1 / np.sqrt(weight.sum()), common))


def _usable(series: Series, channel: int) -> tuple[FloatArray, FloatArray]:
    """Return the usable values of a channel, and their σ."""
    return series.values[series.usable, channel], series.sigma[series.usable, channel]


def _middle_s(series: Series) -> FloatArray:
    return np.asarray((series.t_s + series.exposure_s / 2)[series.usable])


def _interpolate_log(at_s: FloatArray, t_s: FloatArray, log_value: FloatArray) -> FloatArray:
    """Interpolate the logarithm of a decay to some times, in the same unit.

    Beyond the points it is a straight line over log t, as a power law is exactly and an exponential
    approximately over so short a time.
    """
    slope, start = np.polyfit(np.log(t_s), log_value, 1)
    interpolated = np.interp(at_s, t_s, log_value)
    is_beyond = (at_s < t_s[0]) | (at_s > t_s[-1])
    return np.where(is_beyond, start + slope * np.log(at_s), interpolated)


def _warnings(glow: AngularGlow) -> Iterator[ResultWarning]:
    if not is_within_paper(glow.worst):
        yield Contradiction(
            "emission-anisotropic",
            "the emission is not isotropic: at {angle_deg}° it is {ratio.plus_minus} of the "
            "straight view (the paper's samples stay within {usual:.0%}); the model takes it for "
            "the same in all directions. Does the patch still lie inside of the turned sample?",
            angle_deg=glow.worst_angle_deg,
            ratio=glow.worst,
            usual=PAPER_FLUCTUATION,
        )
    if not is_within_paper(glow.drift):
        yield Disturbance(
            "glow-drifts",
            "between the straight views before and after the others the glow changed by a "
            "factor of {ratio.plus_minus}; the drift is assumed to be even in time: was the lamp, "
            "the sample or the camera moved?",
            ratio=glow.drift,
        )
