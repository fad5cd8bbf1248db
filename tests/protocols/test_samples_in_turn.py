"""Samples of a changer that take turns: their order, rests and light in the plan; refusals."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from labrig.acquire import Plan, RigFile, plan, read_protocol, read_rig_file
from labrig.foundation import resources
from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text
from labrig.schema import schema
from tests.protocols.protocol_files import assert_one_clear_line, written
from tests.quick_yaml import read_quickly, write_quickly

BLUE, GREEN = "blue-paint", "green-paint"
REST_S = 300.0
CHAIN: dict[str, Any] = {
    "protocol": "phosphor",
    "samples": [BLUE, {"name": GREEN, "thickness": "0.4 mm"}],
    "parts": [
        {"protocol": "excitation", "at_most": 2, "refine": 0, "direct": ["3 s", "1 min"],
         "rest": {"at_least": "30 s", "at_most": "5 min"}},
        {"protocol": "decay", "charge": "10 min"},
    ],
}  # fmt: skip


def rig_of(folder: Path, **changer: Any) -> RigFile:
    """The shipped rig with other keys of its sample changer."""
    content = read_quickly((resources.folder("config") / "sim-samples.yaml").read_text())
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    content["devices"]["sample_changer"] |= changer
    (folder / "rig.yaml").write_text(write_quickly(content))
    return read_rig_file(folder / "rig.yaml")


def planned(folder: Path, rig: RigFile, **keys: Any) -> Plan:
    return plan(read_protocol(written(folder, **(CHAIN | keys))), rig, "rig.yaml")


def test_the_timeline_is_as_agreed(tmp_path: Path) -> None:
    lines = planned(tmp_path, rig_of(tmp_path)).lines()
    golden = Path(__file__).parent / "samples_in_turn.timeline.txt"
    assert "\n".join(lines) + "\n" == golden.read_text(encoding="utf-8")


def rests(laid_out: Plan) -> dict[str, tuple[float, float]]:
    """Seconds that each unit's sample was away and waited, for units that begin with a rest."""
    found, away_since = {}, dict[str, float]()
    in_place = ""
    for step in laid_out.steps:
        if step.device == "sample_changer":
            away_since[in_place] = step.at_s
            in_place = step.action.removeprefix("sample ")
            found[step.unit] = [step.at_s - away_since.get(in_place, step.at_s), 0.0]
        if step.action.startswith("resting in the dark"):
            assert step.lasts_s is not None
            found[step.unit][1] += step.lasts_s
    return {
        unit: (away_s, waited_s)
        for unit, (away_s, waited_s) in found.items()
        if "/excitation/strip-" in unit or "/excitation/direct-" in unit
    }


def test_what_a_sample_rested_in_the_dark_is_not_waited_for_again(tmp_path: Path) -> None:
    found = rests(planned(tmp_path, rig_of(tmp_path)))
    waited = {unit: times for unit, times in found.items() if not unit.endswith("strip-meter")}
    assert len(waited) == 2 * (2 + 1 + 2)
    assert any(0 < waited_s < REST_S for _, waited_s in waited.values())
    assert any(waited_s == 0 for _, waited_s in waited.values())
    for away_s, waited_s in waited.values():
        # A turn of the changer takes a second.
        assert waited_s == pytest.approx(max(REST_S - away_s - 1.0, 0.0), abs=1e-6)


def test_samples_take_turns_where_they_rest_and_each_arrangement_is_made_once(
    tmp_path: Path,
) -> None:
    laid_out = planned(tmp_path, rig_of(tmp_path))
    strips = ("excitation/strip-meter", "excitation/strip-1", "excitation/strip-2")
    order = [unit for unit in laid_out.units if unit.endswith(strips)]
    assert order == [f"{sample}/{strip}" for strip in strips for sample in (BLUE, GREEN)]
    decays = [unit for unit in laid_out.units if unit.endswith(("/meter", "/decay-1"))]
    assert decays == [
        f"{sample}/decay/{unit}" for sample in (BLUE, GREEN) for unit in ("meter", "decay-1")
    ]
    assert len(laid_out.manual_steps) == 2, "the filter on the samples, and away"


def test_no_light_is_on_while_the_changer_turns(tmp_path: Path) -> None:
    spectra = {"protocol": "emission_spectrum", "charge": "1 min", "times": ["2 s", "10 s"]}
    laid_out = planned(tmp_path, rig_of(tmp_path), parts=[spectra, *CHAIN["parts"]])
    is_on, turns = False, 0
    for step in laid_out.steps:
        if step.device == "lamp":
            is_on = step.action == "on"
        turns += step.device == "sample_changer"
        assert not (is_on and step.device == "sample_changer"), step
    assert turns > 20
    # Nor does a sample lie in the light while the card is photographed for both of them, under one
    # burning lamp.
    white = [step for step in laid_out.steps if step.unit.endswith("/white")]
    assert [step.action for step in white if step.device == "lamp"] == ["on"]
    assert [step.action for step in white if step.device == "sample_changer"] == [
        "all samples into the dark"
    ]


def test_shared_rests_take_less_time_and_the_plan_says_so(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    shared, apart = (planned(tmp_path, rig, rests=way) for way in ("shared", "apart"))
    assert planned(tmp_path, rig) == shared
    assert shared.frames == apart.frames
    units = [unit.partition("/")[0] for unit in apart.units]
    assert sum(one != other for one, other in pairwise(units)) == 1
    assert shared.duration_s < 0.85 * apart.duration_s
    (said,) = read_protocol(written(tmp_path, **CHAIN)).notes(rig)
    for laid_out in (shared, apart):
        assert duration_text(laid_out.duration_s) in said


def test_a_changer_that_says_nothing_of_darkness_shares_no_rests(tmp_path: Path) -> None:
    rig = rig_of(tmp_path, keeps_dark=False)
    protocol = read_protocol(written(tmp_path, **CHAIN))
    assert plan(protocol, rig, "rig.yaml").units == planned(tmp_path, rig, rests="apart").units
    (said,) = protocol.notes(rig)
    assert "keeps_dark: true" in said
    for laid_out in (plan(protocol, rig, "rig.yaml"), planned(tmp_path, rig_of(tmp_path))):
        assert duration_text(laid_out.duration_s) in said
    with pytest.raises(ProtocolError, match="rests: shared is not possible"):
        planned(tmp_path, rig, rests="shared")


def test_what_was_decided_is_written_and_reads_back(tmp_path: Path) -> None:
    protocol: Any = read_protocol(written(tmp_path, **CHAIN)).resolved_for(rig_of(tmp_path))
    assert (protocol.rests, protocol.sample.name) == ("shared", f"{BLUE}, {GREEN}")
    again = written(tmp_path, **protocol.model_dump(mode="json", by_alias=True))
    assert read_protocol(again) == protocol
    assert [part.protocol.sample.thickness for part in protocol.chain()] == [None, None, 0.4, 0.4]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"samples": [BLUE]}, "expected two samples or more"),
        ({"samples": [BLUE, BLUE]}, "expected every sample once"),
        ({"samples": ["a", "A"]}, "differ in more than capital letters"),
        ({"samples": ["a/b", "c"]}, "can be folders"),
        ({"samples": ["decay", "c"]}, "not called like a part, got 'decay'"),
        ({"samples": [BLUE, {"nam": "c"}]}, "samples"),
        ({"sample": {"name": "c"}}, "expected either 'sample' or 'samples'"),
        ({"patches": {"c": [0.1, 0.1, 0.8, 0.3]}}, "expected either 'samples' or 'patches'"),
        ({"rests": "sometimes"}, "rests"),
        ({"parts": [{"protocol": "reflectance"}]}, "that leave the samples on their changer"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    assert_one_clear_line(written(tmp_path, **(CHAIN | keys)), said)


def test_an_editor_takes_names_and_keys_of_samples() -> None:
    validator = Draft202012Validator(schema("protocol"))
    assert validator.is_valid(CHAIN)
    assert not validator.is_valid(CHAIN | {"samples": [{"nam": BLUE}, GREEN]})
    assert not validator.is_valid(CHAIN | {"rests": "sometimes"})


def test_a_rig_without_these_samples_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="has no 'red'; known: blue-paint"):
        planned(tmp_path, rig_of(tmp_path), samples=[BLUE, "red"])
    other = read_rig_file(resources.find("config", "rig", "sim-phosphor"))
    with pytest.raises(ProtocolError, match="expected a sample changer"):
        planned(tmp_path, other)
