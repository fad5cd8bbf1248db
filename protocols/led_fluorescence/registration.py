"""Registration of the measurement `led_fluorescence`."""

from labrig.foundation.plugins import Measurement

LED_FLUORESCENCE = Measurement(
    package=__package__,
    protocol=".protocol:LedFluorescence",
    result=".result:LedFluorescenceResult",
    options=".options:LedFluorescenceOptions",
    is_of_fluorescence=True,
)
