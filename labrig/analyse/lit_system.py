"""The equations of LEDs, lamps and camera, as a card under the same lights makes them known."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from labrig.analyse.lit_patches import LitPatch
from labrig.bench_optics import LedExposure
from labrig.fit.fluorescence import Exposure, FluorescenceSystem, fluorescence_system
from labrig.fit.leds import CURVES_OF_MODEL, SKEW_SIGMA, WIDTH_SIGMA
from labrig.fit.spectrum import CurveError
from labrig.optics import CameraResponse, Transmittance

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


def exposure_of(light: LedExposure) -> Exposure:
    """Return a light of unknown brightness, with the errors of its spectrum.

    The shape of one that is nominal is not known either, nor that of a lamp by another one's file.
    """
    width, skew = (WIDTH_SIGMA, SKEW_SIGMA) if light.is_nominal else (0.0, 0.0)
    error = LAMP_ERROR if light.is_lamp else None
    return Exposure(light.light, 1.0, math.inf, light.wavelength_sigma_nm, width, skew, error)


def lit_system(
    lights: Sequence[LedExposure], camera: CameraResponse, white: Transmittance, card: LitPatch
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
