"""Registrations of measurements: what each is made of is there, and is loaded when asked for."""

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from labrig.acquire import ProtocolModel, read_protocol
from labrig.foundation import plugins
from labrig.foundation.errors import UsageError
from labrig.foundation.plugins import Measurement, measurement, measurements
from labrig.results import RunResult

NAMES = [name for name, _ in measurements()]
LOADED = """
import sys
from labrig.cli import guarded
code = guarded(sys.argv[1:])
print(*(name for name in sys.modules if name.startswith("labrig.")), sep="\\n")
sys.exit(code)
"""


@pytest.mark.parametrize("name", NAMES)
def test_a_measurement_is_one_folder(name: str) -> None:
    registered = measurement(name)
    assert registered.folder.name == name
    protocol, result = registered.load("protocol"), registered.load("result")
    assert issubclass(protocol, ProtocolModel)
    assert protocol.model_fields["protocol"].default == name
    assert issubclass(result, RunResult)
    assert result.kind == name
    assert callable(registered.load("analysis"))
    assert read_protocol(registered.example).protocol == name
    kind = registered.load("calibration")
    assert kind is None or kind.protocol == name


def test_the_bench_is_calibrated_by_what_measures_it() -> None:
    kinds = [(each, each.load("calibration")) for _, each in measurements()]
    assert {kind.of_bench for each, kind in kinds if kind is not None and each.of == "bench"} == {
        True
    }
    assert sum(each.is_bench_check for each, _ in kinds) == 1


def test_a_plan_loads_no_fit_and_no_report() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOADED, "plan", "decay", "--rig", "sim"],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = {line for line in done.stdout.splitlines() if line.startswith("labrig.")}
    assert "labrig.protocols.decay.protocol" in loaded
    parts = {name.split(".")[3] for name in loaded if name.startswith("labrig.protocols.decay.")}
    assert parts == {"protocol"}
    others = [name for name in loaded if name.startswith(("labrig.fit", "labrig.report"))]
    assert not others


@pytest.mark.parametrize(
    "registered",
    [
        Measurement(package="no_such_package", protocol=".protocol:None", result=".result:None"),
        Measurement(package="labrig.protocols.decay", protocol=".protocol:None", result=".r:None"),
    ],
)
def test_a_part_that_cannot_be_imported_is_one_line(registered: Measurement) -> None:
    with pytest.raises(UsageError, match="cannot be imported") as caught:
        registered.load("result")
    assert "\n" not in str(caught.value)


def test_a_package_that_is_broken_stops_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    registry = plugins._registry()
    broken = EntryPoint("broken", "no_such_package:BROKEN", plugins.MEASUREMENTS)
    registered = {**registry[plugins.MEASUREMENTS], "broken": broken}
    monkeypatch.setattr(plugins, "_registry", lambda: registry | {plugins.MEASUREMENTS: registered})
    assert [name for name, _ in measurements()] == NAMES
    with pytest.raises(UsageError, match=r"'broken' .* cannot be imported"):
        measurement("broken")
