"""Registration of the measurement `blank`."""

from labrig.foundation.plugins import Measurement

BLANK = Measurement(
    package=__package__,
    protocol=".protocol:Blank",
    result=".result:BlankResult",
    calibration="labrig.calibration:BLANK_KIND",
    of="bench",
)
