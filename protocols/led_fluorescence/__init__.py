"""Measurement of fluorescence under LEDs."""

from labrig.foundation.plugins import Measurement

LED_FLUORESCENCE = Measurement(
    package=__name__,
    protocol=".protocol:LedFluorescence",
    result=".result:LedFluorescenceResult",
    options=".options:LedFluorescenceOptions",
    is_of_fluorescence=True,
)
