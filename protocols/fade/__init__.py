"""Measurement of the fade of a lamp."""

from labrig.foundation.plugins import Measurement

FADE = Measurement(
    package=__name__,
    protocol=".protocol:Fade",
    result=".result:FadeResult",
    calibration="labrig.calibration:FADE_KIND",
    of="bench",
)
