"""The equations of LEDs and camera, as a card under the same LEDs makes them known."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from labrig.analyse.led_fluorescence.lit_patches import LitPatch
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
#: Least relative σ of a brightness that was calibrated in another run: LEDs age and drift.
DRIFT = 0.01


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
    unknown = [_unknown(led) for led in lights]
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


def _unknown(led: LedExposure) -> Exposure:
    """Return an LED of unknown brightness, whose shape is not known either if it is nominal."""
    width, skew = (WIDTH_SIGMA, SKEW_SIGMA) if led.is_nominal else (0.0, 0.0)
    return Exposure(led.light, 1.0, math.inf, led.wavelength_sigma_nm, width, skew)
