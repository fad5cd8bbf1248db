"""Run the package's protocol with its driver, and compute with its result: `python check.py`."""

import sys
from pathlib import Path

from lamp_drift.result import LampDriftResult

import labrig

(run,) = Path(sys.argv[1]).iterdir()
result = labrig.read_result(run)
assert isinstance(result, LampDriftResult)
assert len(result.time_s) == 12
assert abs(result.drift.value) < 1e-3, result.drift
assert "plain relay 0" in (run / "result" / "report.html").read_text(encoding="utf-8")
print(result.drift)
