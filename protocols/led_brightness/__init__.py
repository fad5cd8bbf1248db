"""Measurement of the brightness of LEDs."""

from labrig.foundation.plugins import Measurement

LED_BRIGHTNESS = Measurement(
    package=__name__,
    protocol=".protocol:LedBrightness",
    result=".result:LedBrightnessResult",
    calibration="labrig.calibration:LEDS_KIND",
    of="bench",
)
