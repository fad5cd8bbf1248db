"""Measurement of stray light of a blank."""

from labrig.foundation.plugins import Measurement

BLANK = Measurement(
    package=__name__,
    protocol=".protocol:Blank",
    result=".result:BlankResult",
    calibration="labrig.calibration:BLANK_KIND",
    of="bench",
)
