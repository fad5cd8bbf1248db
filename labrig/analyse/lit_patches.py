"""Values of patches under LEDs or lamps, and the equations of lights and camera behind them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from labrig.analyse.frames import require_calibrated_camera, steady_frames
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import LightSource
from labrig.calibration import CAMERA_KIND, flicker_of
from labrig.fit.fluorescence import Exposure, FluorescenceSystem, fluorescence_system
from labrig.fit.leds import CURVES_OF_MODEL, SKEW_SIGMA, WIDTH_SIGMA
from labrig.fit.spectrum import CurveError
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.optics import CameraResponse, Transmittance
from labrig.protocols.steps.led_scenes import AGAIN
from labrig.record import FrameRole
from labrig.reduce import reduce_patches
from labrig.results import Measured, Series

#: What lights are called in messages; both kinds together are lights.
LightKind = Literal["LED", "lamp", "light"]

#: Least part of a variance that channels do not have in common: each frame weighs a little
#: differently in them.
MIN_OWN = 0.01


@dataclass(frozen=True, eq=False)
class LitPatch:
    """Values of one patch under m lights, LEDs or lamps, in k channels.

    Attributes
    ----------
    value, variance
        Values in DN/s and their variances, with the frames' flicker, shape (m, k).
    flicker
        Relative σ by flicker that all channels and all patches have in common, shape (m,).
    off, off_sigma
        Values in DN/s just after each light, and their σ, shape (m, k).
    is_clipped, is_off_clipped
        Whether even the shortest exposures were clipped, and whether those without the light were,
        shape (m,).
    bleaching
        Value under the first light at the end of the run over that at its start; None if it was not
        lit again.
    """

    value: FloatArray
    variance: FloatArray
    off: FloatArray
    off_sigma: FloatArray
    is_clipped: BoolArray
    is_off_clipped: BoolArray
    flicker: FloatArray
    bleaching: Measured | None = None

    @property
    def own_variance(self) -> FloatArray:
        """Variances of the values without the flicker that is common, shape (m, k)."""
        own = self.variance - np.square(self.flicker[:, np.newaxis] * self.value)
        return np.maximum(own, MIN_OWN * self.variance)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the channels under each light, shape (m, k, k)."""
        common = self.flicker[:, np.newaxis] * self.value
        own = self.own_variance[:, :, np.newaxis] * np.eye(self.value.shape[1])
        return np.asarray(own + common[:, :, np.newaxis] * common[:, np.newaxis, :])

    @property
    def is_left(self) -> BoolArray:
        """Whether light is left when the light is off, shape (m, k)."""
        return np.asarray(self.off > DETECTION_SIGMA * self.off_sigma)

    @property
    def is_seen(self) -> BoolArray:
        """Whether some channel sees light, shape (m,)."""
        return np.asarray((self.value > DETECTION_SIGMA * np.sqrt(self.variance)).any(axis=1))

    def without_rest(self) -> "LitPatch":
        """Return the values without what is left when the light is off, if there is any."""
        return replace(
            self,
            value=np.where(self.is_left, self.value - self.off, self.value),
            variance=np.where(self.is_left, self.variance + self.off_sigma**2, self.variance),
        )

    def under(self, rows: Sequence[int]) -> "LitPatch":
        """Return the values under some of the lights."""
        return LitPatch(
            self.value[rows],
            self.variance[rows],
            self.off[rows],
            self.off_sigma[rows],
            self.is_clipped[rows],
            self.is_off_clipped[rows],
            self.flicker[rows],
            self.bleaching,
        )

    def times(self, factor: FloatArray, relative_variance: FloatArray) -> "LitPatch":
        """Return the values under each light times a factor with an error, each shape (m,)."""
        by = factor[:, np.newaxis]
        value = self.value * by
        variance = self.variance * by**2 + value**2 * relative_variance[:, np.newaxis]
        off, off_sigma = self.off * by, self.off_sigma * by
        return replace(self, value=value, variance=variance, off=off, off_sigma=off_sigma)


def lit_patches(
    context: AnalysisContext,
    role: str,
    begin: str,
    lights: Sequence[str],
    first: str | None = None,
    patches: Mapping[str, Region] | None = None,
) -> dict[str, LitPatch]:
    """Return each patch under all lights, in their order.

    Parameters
    ----------
    part
        The run.
    role
        Role of the frames with a light on; `-off` is added for those with all lights off.
    begin
        Start of the names of the units, which end with the light.
    lights
        Names of the lights.
    first
        Light under which the patches were photographed once more at the end; None for none.
    patches
        Regions of the patches; None for those of the protocol.

    Raises
    ------
    DataError
        Frames are missing, damaged, or of another camera than the calibrated one.
    """
    camera = context.inputs[CAMERA_KIND]
    flicker = flicker_of(camera)
    lit, left = (_series(context, each, patches) for each in (role, f"{role}-off"))
    units = [f"{begin}{light}" for light in lights]
    again = None if first is None else (f"{begin}{first}", f"{AGAIN}{first}")
    return {
        name: _lit_patch(context, series, left[name], units, again, flicker)
        for name, series in lit.items()
    }


def mean_of(patches: Mapping[str, LitPatch]) -> LitPatch:
    """Return the mean of some patches, with the variance of one: neighbours share their light."""
    each = list(patches.values())
    return LitPatch(
        np.mean([patch.value for patch in each], axis=0),
        np.mean([patch.variance for patch in each], axis=0),
        np.mean([patch.off for patch in each], axis=0),
        np.mean([patch.off_sigma for patch in each], axis=0),
        np.any([patch.is_clipped for patch in each], axis=0),
        np.any([patch.is_off_clipped for patch in each], axis=0),
        np.min([patch.flicker for patch in each], axis=0),
    )


def _series(
    context: AnalysisContext, role: str, patches: Mapping[str, Region] | None
) -> dict[str, Series]:
    run, camera = context.run, context.inputs[CAMERA_KIND]
    frames = steady_frames(run, context.overrides, role)
    if not frames:
        raise DataError(
            f"{run.folder}: there are no complete '{role}' frames; go on with: labrig resume "
            f"{run.folder}"
        )
    require_calibrated_camera(camera, run, run.frames(role))
    darks = steady_frames(run, context.overrides, FrameRole.DARK)
    regions = context.overrides.patches(context.protocol) if patches is None else patches
    return reduce_patches(frames, regions, darks, camera=camera)


def _lit_patch(
    context: AnalysisContext,
    series: Series,
    left: Series,
    units: Sequence[str],
    again: tuple[str, str] | None,
    flicker: float,
) -> LitPatch:
    lit = {unit.unit[0]: _merged(unit, flicker) for unit in series.by_unit()}
    off = {
        unit.unit[0]: (unit.values[0], unit.sigma[0], not unit.usable[0]) for unit in left.by_unit()
    }
    if missing := [unit for unit in units if unit not in lit or unit not in off]:
        raise DataError(
            f"{context.run.folder}: the unit '{missing[0]}' is not complete; go on with: labrig "
            f"resume {context.run.folder}"
        )
    columns = [np.array(column) for column in zip(*(lit[unit] for unit in units), strict=True)]
    offs = [np.array(column) for column in zip(*(off[unit] for unit in units), strict=True)]
    value, variance, is_clipped, common = columns
    dark, dark_sigma, is_off_clipped = offs
    bleaching = None
    if again is not None and again[1] in lit:
        bleaching = _ratio(lit[again[1]], lit[again[0]])
    return LitPatch(
        value, variance, dark, dark_sigma, is_clipped, is_off_clipped, common, bleaching
    )


def _merged(unit: Series, flicker: float) -> tuple[FloatArray, FloatArray, bool, float]:
    """Merge a bracket: values (k,), variances (k,), whether all frames are clipped, and flicker."""
    usable = unit.usable
    if not usable.any():
        return unit.values[0], np.square(unit.sigma[0]), True, 0.0
    value, variance = unit.values[usable], np.square(unit.sigma[usable])
    # Flicker is that of the mean: of each value itself, it would prefer the low ones.
    mean = (value / variance).sum(axis=0) / (1 / variance).sum(axis=0)
    weight = 1 / (variance + np.square(flicker * mean))
    mean = (weight * value).sum(axis=0) / weight.sum(axis=0)
    # Channels weigh the frames differently: common is what the one with least flicker has.
    common = flicker * np.linalg.norm(weight, axis=0) / weight.sum(axis=0)
    return mean, 1 / weight.sum(axis=0), False, float(common.min())


def _ratio(
    after: tuple[FloatArray, FloatArray, bool, float],
    before: tuple[FloatArray, FloatArray, bool, float],
) -> Measured:
    """Return the ratio of two brackets, of the channels together."""
    weight = before[0] / before[1]
    numerator, denominator = weight @ after[0], weight @ before[0]
    relative = weight**2 @ after[1] / numerator**2 + weight**2 @ before[1] / denominator**2
    ratio = numerator / denominator
    return Measured(float(ratio), float(abs(ratio) * np.sqrt(relative)))


#: Relative σ of a grey card's reflectance.
CARD_SIGMA = 0.01
#: How its reflectance over wavelength differs from the curve of its file: cards age, get dirty, and
#: differ from one another.
CARD_COURSE = CurveError(relative=0.01, added=0.0, correlation_nm=100.0)
#: Relative σ of its reflectance for ultraviolet light relative to the visible: pigments and their
#: binders begin to absorb there.
CARD_UV_SIGMA = 0.02
#: Error of a lamp's spectrum by a file of another lamp of its kind.
LAMP_ERROR = CurveError(relative=0.08, added=0.01, correlation_nm=40.0)
#: Least relative σ of a brightness that was calibrated in another run: LEDs age and drift.
DRIFT = 0.01


def exposure_of(light: LightSource) -> Exposure:
    """Return a light of unknown brightness, with the errors of its spectrum.

    The shape of one that is nominal is not known either, nor that of a lamp by another one's file.
    """
    width, skew = (WIDTH_SIGMA, SKEW_SIGMA) if light.is_nominal else (0.0, 0.0)
    error = LAMP_ERROR if light.is_lamp else None
    return Exposure(light.light, 1.0, math.inf, light.wavelength_sigma_nm, width, skew, error)


def lit_system(
    lights: Sequence[LightSource], camera: CameraResponse, white: Transmittance, card: LitPatch
) -> FluorescenceSystem:
    """Return the system of some LEDs, lamps and a camera.

    The card tells the brightness of every light that the camera sees. That of the others follows
    from a calibration, on whose scale the card puts those that both know.

    Parameters
    ----------
    lights
        LEDs and lamps, with brightnesses on a scale of their own or none.
    camera, white
        Curves of the camera, and reflectance of the card.
    card
        Values of the card under the lights.
    """
    unknown = [exposure_of(led) for led in lights]
    bare = fluorescence_system(unknown, camera, CURVES_OF_MODEL)
    by_card = bare.informed_by_white(card.value, card.variance, white, CARD_SIGMA, CARD_COURSE)
    calibrated = np.array([np.isfinite(led.brightness_sigma) for led in lights])
    both, missing = calibrated & ~by_card.is_loose, calibrated & by_card.is_loose
    if not (both.any() and missing.any()):
        return by_card
    ratios = by_card.brightness[both] / np.array([led.brightness for led in lights])[both]
    scale = float(np.median(ratios))
    scatter = float(np.std(np.log(ratios))) if both.sum() > 1 else 0.0
    exposures = [
        replace(
            exposure,
            brightness=scale * led.brightness,
            brightness_sigma=scale
            * led.brightness
            * math.hypot(led.brightness_sigma / led.brightness, max(scatter, DRIFT), CARD_UV_SIGMA),
        )
        if is_missing
        else exposure
        for exposure, led, is_missing in zip(unknown, lights, missing, strict=True)
    ]
    return fluorescence_system(exposures, camera, CURVES_OF_MODEL).informed_by_white(
        card.value, card.variance, white, CARD_SIGMA, CARD_COURSE
    )
