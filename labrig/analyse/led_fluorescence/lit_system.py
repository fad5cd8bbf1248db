"""The equations of LEDs, lamps and camera, as a card under the same LEDs makes them known."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from labrig.analyse.led_fluorescence.lit_patches import LitPatch
from labrig.bench_optics import LedExposure
from labrig.fit.fluorescence import Exposure, FluorescenceSystem, fluorescence_system
from labrig.fit.leds import CURVES_OF_MODEL
from labrig.fit.spectrum import CurveError
from labrig.optics import CameraResponse, Transmittance

#: Relative σ of a grey card's reflectance.
CARD_SIGMA = 0.01
#: Error of a lamp's spectrum by a file of another lamp of its kind.
LAMP_ERROR = CurveError(relative=0.08, added=0.01, correlation_nm=40.0)
#: Least relative σ of a brightness that was calibrated in another run: LEDs age and drift.
DRIFT = 0.01


def exposure_of(light: LedExposure) -> Exposure:
    """Return a light of unknown brightness, with the errors of its spectrum."""
    error = LAMP_ERROR if light.is_lamp else None
    return Exposure(light.light, 1.0, math.inf, light.wavelength_sigma_nm, error)


def lit_system(
    lights: Sequence[LedExposure], camera: CameraResponse, white: Transmittance, card: LitPatch
) -> FluorescenceSystem:
    """Return the system of some LEDs and a camera.

    The card tells the brightness of every LED that the camera sees. That of the others follows
    from a calibration, on whose scale the card puts those that both know.

    Parameters
    ----------
    lights
        The LEDs, with brightnesses on a scale of their own or none.
    camera, white
        Curves of the camera, and reflectance of the card.
    card
        Values of the card under the LEDs.
    """
    unknown = [exposure_of(led) for led in lights]
    bare = fluorescence_system(unknown, camera, CURVES_OF_MODEL)
    by_card = bare.informed_by_white(card.value, card.variance, white, CARD_SIGMA)
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
            * float(np.hypot(led.brightness_sigma / led.brightness, max(scatter, DRIFT))),
        )
        if is_missing
        else exposure
        for exposure, led, is_missing in zip(unknown, lights, missing, strict=True)
    ]
    return fluorescence_system(exposures, camera, CURVES_OF_MODEL).informed_by_white(
        card.value, card.variance, white, CARD_SIGMA
    )
