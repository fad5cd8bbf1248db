"""Registration of the measurement `led_brightness`."""

from labrig.foundation.plugins import Measurement

LED_BRIGHTNESS = Measurement(
    package=__package__,
    protocol=".protocol:LedBrightness",
    result=".result:LedBrightnessResult",
    calibration="labrig.calibration:LEDS_KIND",
    of="bench",
)
