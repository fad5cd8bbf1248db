"""Registration of the measurement `fade`."""

from labrig.foundation.plugins import Measurement

FADE = Measurement(
    package=__package__,
    protocol=".protocol:Fade",
    result=".result:FadeResult",
    calibration="labrig.calibration:FADE_KIND",
    of="bench",
)
