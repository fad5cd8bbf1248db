"""Emission spectrum, isotropy, saturation: timelines, refusals, the changer, resume."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import read_protocol
from labrig.cli.exit_codes import guarded
from labrig.foundation.errors import ProtocolError
from labrig.record import read_run
from tests.analyse.spectral_bench import write_bench
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)
from tests.quick_yaml import read_quickly, write_quickly

PROTOCOLS = ("emission_spectrum", "isotropy", "saturation")


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_timeline_of_the_shipped_protocol_is_as_agreed(name: str) -> None:
    assert_timeline_as_agreed(name, "sim-phosphor")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"protocol": "emission_spectrum", "times": ["10 s", "2 s"]}, "expected rising times"),
        ({"protocol": "emission_spectrum", "times": []}, "times"),
        ({"protocol": "emission_spectrum", "lamps": ["xenon"]}, "lamps"),
        ({"protocol": "emission_spectrum", "lamps": ["halogen"] * 2}, "every lamp once"),
        ({"protocol": "emission_spectrum", "time": ["2 s"]}, "did you mean 'times'?"),
        ({"protocol": "isotropy", "angles": [0, 20]}, "every angle once and none of 0°"),
        ({"protocol": "isotropy", "angles": [20, 20]}, "every angle once"),
        ({"protocol": "isotropy", "angles": [90]}, "angles"),
        ({"protocol": "isotropy", "patch": "beside"}, "patch"),
        ({"protocol": "saturation", "charges": ["5 min"]}, "charges"),
        ({"protocol": "saturation", "charges": ["5 min", "2 min"]}, "expected rising charges"),
        ({"protocol": "saturation", "weaker": {"fraction": "50 %"}}, "either 'filter: NAME'"),
        ({"protocol": "saturation", "weaker": {"filter": "nd", "fraction": 2}}, "fraction"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    assert_one_clear_line(written(tmp_path, **keys), said)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"protocol": "emission_spectrum", "times": ["2 s", "2.5 s"]}, "(every: 1.7 s)"),
        ({"protocol": "emission_spectrum", "times": ["300 ms", "8 s"]}, "door"),
        ({"protocol": "emission_spectrum", "camera": {"iso": 12800}}, "does not offer ISO"),
        ({"protocol": "isotropy", "every": "1 s"}, "(every: 1.7 s)"),
        ({"protocol": "saturation", "exposure": "8 s"}, "(every: 9.2 s)"),
        ({"protocol": "saturation", "first": "100 ms"}, "door"),
    ],
)
def test_a_plan_that_cannot_work_is_refused(
    tmp_path: Path, keys: dict[str, Any], said: str
) -> None:
    with pytest.raises(ProtocolError) as caught:
        planned(written(tmp_path, **keys), "sim-phosphor")
    assert said in str(caught.value)


def test_a_written_protocol_reads_back_as_itself(tmp_path: Path) -> None:
    for keys in (
        {"protocol": "emission_spectrum", "lamps": ["mercury", "halogen"], "times": ["1 s", "9 s"]},
        {"protocol": "isotropy", "patch": "around", "angles": [-60, 60]},
        {"protocol": "saturation", "weaker": {"distance": "1.4 m", "fraction": "50 %"},
         "exposure": "2 s"},
    ):  # fmt: skip
        protocol = read_protocol(written(tmp_path, **keys))
        again = write_quickly(protocol.model_dump(mode="json", by_alias=True))
        (tmp_path / "again.yaml").write_text(again)
        assert read_protocol(tmp_path / "again.yaml") == protocol


def manual_steps(tmp_path: Path, **keys: Any) -> list[tuple[str, str]]:
    laid_out = planned(written(tmp_path, **keys), "sim-phosphor")
    return [(step.unit, step.action) for step in laid_out.steps if step.device == "person"]


def test_hands_move_as_little_as_they_can_and_put_all_back(tmp_path: Path) -> None:
    steps = manual_steps(tmp_path, protocol="emission_spectrum", lamps=["halogen", "mercury"])
    assert [unit for unit, _ in steps] == [
        "dark", "meter-mercury", "white", "white", "put-back", "put-back",
    ]  # fmt: skip
    assert "mercury lamp" in steps[1][1]
    assert "halogen lamp" in steps[2][1]
    steps = manual_steps(tmp_path, protocol="emission_spectrum", lamps=["mercury"], white=False)
    assert [unit for unit, _ in steps] == ["dark", "meter-mercury", "put-back", "put-back"]
    steps = manual_steps(tmp_path, protocol="isotropy", angles=[20, 40])
    turns = [action.split(" by ")[1].split("°")[0] for _, action in steps]
    assert turns == ["20", "0", "40", "0"]
    weaker = {"filter": "neutral-50", "fraction": "50 %"}
    steps = manual_steps(tmp_path, protocol="saturation", weaker=weaker)
    assert [unit for unit, _ in steps] == ["meter-weaker", "meter-full"]


def test_the_lamp_warms_up_once_for_the_card_in_all_filters_and_is_off_for_the_sample(
    tmp_path: Path,
) -> None:
    filters = {"filters": ["bandpass-450", "bandpass-500", "bandpass-550", "longpass-660"]}
    laid_out = planned(
        written(tmp_path, protocol="emission_spectrum", select=filters), "sim-phosphor"
    )
    white = [step for step in laid_out.steps if step.unit.startswith("white-")]
    assert len({step.unit for step in white}) == 5
    assert [step.action for step in white if step.device == "lamp"] == ["on"]
    assert sum(step.lasts_s for step in white if step.lasts_s) == pytest.approx(900.0, abs=5.0)
    is_on = False
    for step in laid_out.steps:
        if step.device == "lamp":
            is_on = step.action == "on"
        assert not (is_on and step.action.startswith(("dark frame", "take the card away")))


def test_a_run_that_had_no_disk_left_goes_on_where_it_was(tmp_path: Path) -> None:
    """The bench is as it was left: the filter is still before the camera."""
    keys = {"protocol": "emission_spectrum", "charge": "1 min", "times": ["2 s", "10 s"],
            "longest": "4 s", "white": False}  # fmt: skip
    protocol = written(tmp_path, **keys)
    laid_out = planned(protocol, write_bench(tmp_path))
    first = next(step for step in laid_out.steps if step.action.startswith("spectrum frame"))
    # The simulated changer takes no time.
    at_s = first.at_s - sum(step.device == "person" and step.at_s < first.at_s
                            for step in laid_out.steps) * 60.0 + 3.0  # fmt: skip
    rig = write_bench(tmp_path, faults=[{"disk_full": {"at": f"{at_s} s"}}])
    runs = tmp_path / "runs"
    run = ["run", str(protocol), "--rig", str(rig), "--runs", str(runs), "--yes", "--no-process"]
    assert guarded(run) == 5
    (folder,) = runs.iterdir()
    before = read_run(folder).completed()
    assert list(before) == ["dark", "meter-halogen"]
    content = read_quickly((folder / "rig.yaml").read_text())
    content["simulation"] |= {"faults": []}
    content["simulation"]["initial"] |= {"manual_steps": ["lvf before camera"]}
    (folder / "rig.yaml").write_text(write_quickly(content))
    assert guarded(["resume", str(folder), "--edited", "--yes", "--no-process"]) == 0
    after = read_run(folder).completed()
    assert tuple(after) == laid_out.units
    assert after["dark"].uid == before["dark"].uid
    assert len(read_run(folder).frames("spectrum")) == 2
