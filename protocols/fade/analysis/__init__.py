"""Analysis of a fade run, from its frames to its result."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from labrig.analyse.frames import part_frames, part_region, require_calibrated_camera
from labrig.analyse.inputs import Part
from labrig.bench_optics import camera_curves, lamp_spectrum
from labrig.calibration import CAMERA_KIND, LVF_KIND, Change, FadeFile, Warming
from labrig.fit.spectrum import CurveError, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.number_format import plus_minus
from labrig.foundation.region import Region
from labrig.optics import CameraResponse, Spectrum
from labrig.protocols.fade.analysis.change import FittedChange
from labrig.protocols.fade.analysis.fit import fit_change
from labrig.protocols.fade.analysis.frames import (
    brightest_channels,
    frames_after_switch,
    take_columns,
    warming,
)
from labrig.protocols.fade.protocol import SWITCHED, LampFrames
from labrig.protocols.fade.result import FadeResult, LampChange, WarmingLight
from labrig.record import FrameRecord, FrameRole
from labrig.reduce import sensor_layout

#: Relative flicker of a photograph without a camera file.
TYPICAL_FLICKER = 0.007
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


def analyse(part: Part) -> FadeResult:
    """Measure the lamp's turn-off, turn-on and warm-up transients.

    Raises
    ------
    DataError, FitError
        The photographs show no switched lamp.
    UsageError
        The rig file does not name the curves of lamp and camera.
    """
    protocol, camera = part.protocol, part.inputs[CAMERA_KIND]
    curves = camera_curves(part.rig, part.overrides.camera, part.inputs[LVF_KIND])
    lamp = lamp_spectrum(part.rig)
    frames = part_frames(part, LampFrames.FADE, LampFrames.RISE, LampFrames.STEADY)
    require_calibrated_camera(camera, part.run, frames)
    darks = part_frames(part, FrameRole.DARK)
    flicker = TYPICAL_FLICKER if camera is None else camera.flicker
    edges = np.array(protocol.bands)
    nm = np.arange(edges[0], edges[-1] + STEP_NM / 2, STEP_NM)
    places, weights, errors = _places(part, frames, curves, lamp, nm)
    bands = _band_weights(edges, lamp, nm)
    changes: dict[str, LampChange] = {}
    tables: dict[str, Change] = {}
    fade: FittedChange | None = None
    for role in SWITCHED if protocol.rise else SWITCHED[:1]:
        switched = frames_after_switch(part.run, frames, darks, places, camera, role)
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
    warm, warming_light = _fit_warming(part, darks, flicker)
    file = FadeFile(
        lamp=lamp.name,
        bands_nm=protocol.bands,
        fade=tables["fade"],
        rise=tables.get("rise"),
        warming=warm,
        source="measured with labrig, fade",
        run=part.run.name,
    )
    return FadeResult(
        calibration=file,
        fade=changes["fade"],
        rise=changes.get("rise"),
        warming=warming_light,
        warnings=tuple(_warnings(changes)),
    )


def _fit_warming(
    part: Part, darks: Sequence[FrameRecord], flicker: float
) -> tuple[Warming, WarmingLight] | tuple[None, None]:
    frames = part_frames(part, LampFrames.WARMING)
    if not frames:
        return None, None
    card = part_region(part, part.protocol.card)
    return warming(part.run, frames, darks, card, part.inputs[CAMERA_KIND], flicker)


def _places(
    part: Part,
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
    if not part.protocol.through_lvf:
        changes = camera_modes(curves, nm, CURVES)
        light_errors = np.array([(light * change).T for change in changes])
        card = {"card": part_region(part, part.protocol.card)}
        return card, _normalise(channel_light), _normalised_errors(channel_light, light_errors)
    lvf = part.inputs[LVF_KIND]
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


def _warnings(changes: Mapping[str, LampChange]) -> Iterator[str]:
    for role, change in changes.items():
        if change.best.reduced_chi2 > BAD_CHI2 + BAD_SIGMAS * np.sqrt(2 / change.best.dof):
            yield (
                f"the {role} is not that of a glowing body (χ² {change.best.reduced_chi2:.1f} a "
                "degree of freedom): is it a halogen lamp, and are its spectrum and the camera's "
                "curves those of this bench?"
            )
        exponent, sigma = change.exponent.value, change.exponent.sigma
        if abs(exponent - 1) > max(0.1, 4 * sigma):
            yield (
                f"the {role} follows the wavelength with an exponent of "
                f"{plus_minus(exponent, sigma)}, a glowing body has 1: see optics.lamp and "
                "optics.camera in the rig file"
            )
        if clipped := change.frames.clipped:
            yield f"{clipped} photographs of the {role} clip and are left out; lower camera.iso"
