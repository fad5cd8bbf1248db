"""Registration of the protocol `hold` of `tests.lit_bench`."""

from labrig.foundation.plugins import Measurement

HOLD = Measurement(
    package="tests", protocol=".lit_bench:Hold", result="labrig.results:RunResult", report=None
)
