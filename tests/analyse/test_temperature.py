"""What becomes of a temperature: from a drifting room to the report's warning."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import plan, read_protocol, read_rig_file
from labrig.foundation import resources
from labrig.foundation.result_warning import ResultWarning
from labrig.material import read_material
from labrig.process import process_run
from labrig.protocols.decay.result import DecayResult
from labrig.record import read_run
from labrig.report import describe_phosphor
from tests.analyse.recorded import record
from tests.quick_yaml import read_quickly, write_quickly
from tests.warned import codes

DECAY: dict[str, Any] = {
    "protocol": "decay", "charge": "30 s", "first": "1 s", "every": "25 s", "for": "10 min",
    "exposure": "1/4 s", "daylight": False,
    "sample": {"name": "paint", "thickness": "400 um", "mass_per_area": "300 g/m2"},
}  # fmt: skip


def recorded(folder: Path, **simulation: Any) -> Path:
    def change(rig: dict[str, Any]) -> None:
        rig["devices"]["lamp"]["warm_up"] = "30 s"
        rig["devices"]["camera"]["warm_up"] = "5 s"
        rig["simulation"] |= {"sensor": {"width": 48, "height": 32}, **simulation}

    return record(folder, DECAY, change)


def test_a_drifting_room_is_shown_and_reported(tmp_path: Path) -> None:
    run = recorded(tmp_path, temperature={"start": 19, "drift_per_hour": 9})
    result = process_run(run)
    (warning,) = result.warnings
    assert warning.code == "temperature-moved"
    moved = warning.values["change_k"]
    frames = read_run(run).frames("decay")
    hours = (frames[-1].start_time - frames[0].start_time) / 3600
    assert moved == pytest.approx(9 * hours, abs=0.3)
    assert warning.values["rate_change"] == pytest.approx(1.089**moved - 1, abs=0.015)
    page = (run / "result" / "report.html").read_text()
    assert "<h2>Temperature</h2>" in page
    assert "the temperature moved by" in page
    assert list((run / "result" / "figures").glob("*temperature*.svg"))
    provenance = read_material(run / "result" / "material.yaml").provenance
    assert provenance is not None
    middle = (frames[0].start_time + frames[-1].end_time) / 2 - frames[0].start_time
    began = read_run(run).attempts[0].start["time"]
    true_c = 19 + 9 * (frames[0].start_time + middle - began) / 3600
    assert provenance.temperature_c == pytest.approx(true_c, abs=1.0)


def test_a_steady_room_is_shown_without_a_warning(tmp_path: Path) -> None:
    run = recorded(tmp_path)
    result = process_run(run)
    assert not [code for code in codes(result.warnings) if "temperature" in code]
    assert "<h2>Temperature</h2>" in (run / "result" / "report.html").read_text()


def test_the_layer_that_the_protocol_states_is_that_of_the_material(tmp_path: Path) -> None:
    run = recorded(tmp_path)
    process_run(run)
    material = read_material(run / "result" / "material.yaml")
    assert material.thickness_mm == pytest.approx(0.4, rel=1e-12)
    assert material.mass_per_area_g_per_m2 == 300.0
    shown = describe_phosphor(material)
    assert "thickness 0.4 mm" in " ".join(shown.split())
    assert "mass per area 300 g/m²" in " ".join(shown.split())


def test_a_slow_drift_is_told_where_rates_are_known_better(tmp_path: Path) -> None:
    """A quarter of a kelvin in the glow is less than the thermometer shows in its ten minutes."""

    def recorded_for(drift_per_hour: float) -> list[ResultWarning]:
        def change(rig: dict[str, Any]) -> None:
            rig["simulation"] |= {
                "sensor": {"width": 48, "height": 32},
                "temperature": {"drift_per_hour": drift_per_hour},
            }

        folder = tmp_path / str(drift_per_hour)
        result = process_run(record(folder, DECAY | {"charge": "1 h"}, change))
        return [each for each in result.warnings if each.code == "temperature-drifts"]

    assert recorded_for(0.0) == []
    (warning,) = recorded_for(1.8)
    assert warning.values["drift_k_per_h"] == pytest.approx(1.8, abs=0.4)
    assert warning.values["rate_change_percent"] == pytest.approx(2.7, abs=0.8)


@pytest.mark.parametrize(
    ("off", "readings", "code"),
    [
        pytest.param("0 s", 0, "no-temperature", marks=pytest.mark.campaign),
        ("1 min", 3, "temperature-ends"),
    ],
)
def test_a_thermometer_that_fails_does_not_end_a_run(
    tmp_path: Path, off: str, readings: int, code: str
) -> None:
    run = recorded(tmp_path, faults=[{"thermometer_off": {"at": off}}])
    assert [attempt.exit_status for attempt in read_run(run).attempts] == ["success"] * 2
    assert len(read_run(run).temperatures()) == readings
    result = process_run(run)
    of_thermometer = {"no-temperature", "temperature-ends"}
    assert [each for each in codes(result.warnings) if each in of_thermometer] == [code]


def test_no_plan_takes_longer_for_it(tmp_path: Path) -> None:
    content = read_quickly((resources.folder("config") / "sim-phosphor.yaml").read_text())
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    (tmp_path / "decay.yaml").write_text(write_quickly(DECAY))
    protocol = read_protocol(tmp_path / "decay.yaml")
    plans = []
    for name in ("with", "without"):
        (tmp_path / f"{name}.yaml").write_text(write_quickly(content))
        plans.append(plan(protocol, read_rig_file(tmp_path / f"{name}.yaml"), name))
        content["devices"].pop("thermometer", None)
    assert plans[0] == plans[1]


def test_what_a_temperature_that_was_not_recorded_may_change_is_stated(tmp_path: Path) -> None:
    """No data tell a drift of a kelvin an hour; without a thermometer its size is in the result."""

    def change(rig: dict[str, Any]) -> None:
        rig["simulation"] |= {"sensor": {"width": 48, "height": 32}}
        del rig["devices"]["thermometer"]

    often = DECAY | {"charge": "1 h", "every": "5 s", "for": "3 min", "exposure": "1 s"}
    run = record(tmp_path / "without", often, change)
    result = process_run(run)
    assert isinstance(result, DecayResult)
    assert not [code for code in codes(result.warnings) if "temperature" in code]
    (patch,) = result.patches.values()
    assert patch.fit is not None
    assert patch.drift_effect is not None
    # What light there is comes within some lifetimes, in which a rate changes by 9 % a kelvin.
    lifetimes = patch.drift_effect[0, 0] / (0.091 / 3600) * patch.fit.states[0].k_r_per_s
    assert 0.5 < lifetimes < 3
    assert "The temperature was not recorded" in (run / "result" / "report.html").read_text()
    known = process_run(recorded(tmp_path / "with"))
    assert isinstance(known, DecayResult)
    assert [patch.drift_effect for patch in known.patches.values()] == [None]
