"""Compute with the results of two runs, the second with the first one's calibration.

python check.py FIRST SECOND
"""

import sys
from pathlib import Path

from lamp_drift.calibration import DRIFT_KIND
from lamp_drift.result import LampDriftResult

import labrig

first, second = map(Path, sys.argv[1:])
result = labrig.read_result(first)
assert isinstance(result, LampDriftResult)
assert len(result.time_s) == 12
assert abs(result.drift.value) < 1e-3, result.drift
assert result.change_sigmas is None
assert "plain board, relay 0" in (first / "result" / "report.html").read_text(encoding="utf-8")
assert DRIFT_KIND.read(first).drift_per_s == result.drift.value
# A notebook shows it as it shows labrig's own.
assert "drift" in result._repr_html_()
assert result.plot().axes[0].get_xlabel() == "Time / s"
assert result.refit().drift == result.drift
later = labrig.read_result(second)
assert isinstance(later, LampDriftResult)
assert later.change_sigmas is not None
assert abs(later.change_sigmas) < 5, later.change_sigmas
print(result.drift, later.change_sigmas)
