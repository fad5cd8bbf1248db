"""Spectra and brightnesses of narrow-band LEDs from a white reference."""

from labrig.fit.leds.band import LedBand, led_band, light_within
from labrig.fit.leds.brightness import (
    CURVES_OF_MODEL,
    RESPONSE_CALIBRATED,
    RESPONSE_UNKNOWN,
    SKEW_SIGMA,
    WIDTH_SIGMA,
    BrightnessFit,
    LedLightMeasured,
    ResponseError,
    centroid_nm,
    changed_spectrum,
    fit_brightness,
)
from labrig.fit.leds.identity import ChannelMatch, match_channels

__all__ = [
    "CURVES_OF_MODEL",
    "RESPONSE_CALIBRATED",
    "RESPONSE_UNKNOWN",
    "SKEW_SIGMA",
    "WIDTH_SIGMA",
    "BrightnessFit",
    "ChannelMatch",
    "LedBand",
    "LedLightMeasured",
    "ResponseError",
    "centroid_nm",
    "changed_spectrum",
    "fit_brightness",
    "led_band",
    "light_within",
    "match_channels",
]
