"""Lights that are selected one after another: what the bench is asked for."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import Plan, plan, read_protocol, read_rig_file
from labrig.foundation.errors import ProtocolError, UsageError
from tests.analyse.selected_lights import FILTERS, LED_NAMES, QUICK, SELECTIONS, bench
from tests.quick_yaml import read_quickly, write_quickly


def planned(folder: Path, kind: str, **keys: Any) -> Plan:
    rig = read_quickly(Path("config/sim-phosphor.yaml").read_text(encoding="utf-8"))
    bench(kind)(rig)
    del rig["simulation"]
    (folder / "rig.yaml").write_text(write_quickly(rig))
    protocol = QUICK | {"select": SELECTIONS[kind]} | keys
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    rig_file = read_rig_file(folder / "rig.yaml")
    return plan(read_protocol(folder / "protocol.yaml"), rig_file, "rig.yaml")


def actions(of: Plan, device: str) -> list[str]:
    return [step.action for step in of.steps if step.device == device]


def test_filters_are_put_in_by_hand_one_after_another(tmp_path: Path) -> None:
    found = planned(tmp_path, "filters")
    steps = [f"put the colour filter {name} before the lamp" for name in FILTERS]
    assert list(found.manual_steps) == [*steps, "take the colour filter out"]
    assert found.units[1:5] == (
        "band-shortpass-430-meter",
        "band-shortpass-430-1",
        "band-shortpass-430-2",
        "band-bandpass-450-meter",
    )


def test_a_wheel_takes_the_place_of_a_person_for_the_filters_that_it_has(tmp_path: Path) -> None:
    found = planned(tmp_path, "wheel")
    steps = [f"put the colour filter {name} before the lamp" for name in FILTERS[5:]]
    assert list(found.manual_steps) == [*steps, "take the colour filter out"]
    turned = list(dict.fromkeys(actions(found, "filter_wheel")))
    assert turned == ["no filter", *(f"filter {name}" for name in FILTERS[:5])]


def test_a_monochromator_is_put_in_once_and_tuned(tmp_path: Path) -> None:
    found = planned(tmp_path, "monochromator")
    assert found.manual_steps == (
        "put the monochromator between lamp and sample",
        "take the monochromator out of the lamp's light",
    )
    tuned = list(dict.fromkeys(actions(found, "monochromator")))
    assert tuned == [f"{nm} nm" for nm in SELECTIONS["monochromator"]["monochromator"]]


def test_leds_charge_without_a_hand_and_without_the_lamp(tmp_path: Path) -> None:
    found = planned(tmp_path, "leds")
    assert found.manual_steps == ()
    lit = [action for action in actions(found, "leds") if action != "off"]
    assert lit == [f"{name} on" for name in LED_NAMES for _ in range(3)]
    # One metering and three charges by the lamp itself.
    assert actions(found, "lamp").count("on") == 4


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"select": {}}, "expected lights of one kind"),
        ({"select": {"leds": ["a"], "filters": ["b"]}}, "got filters and leds"),
        ({"select": {"leds": ["a", "a"]}}, "expected every light once"),
        ({"charges": ["5 min", "30 s"]}, "expected charges in 'charges' that become longer"),
        (
            {"protocol": "irradiance", "select": {"leds": ["a", "b"]}},
            "expected at least one light for each of the 8 bands, got 2",
        ),
    ],
)
def test_a_selection_that_cannot_be(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    content = {"protocol": "excitation"} | keys
    (tmp_path / "protocol.yaml").write_text(write_quickly(content))
    with pytest.raises(UsageError, match=said):
        read_protocol(tmp_path / "protocol.yaml")


def test_a_light_that_the_rig_has_not(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="which the rig has not"):
        planned(tmp_path, "leds", select={"leds": ["333 nm"]})
    with pytest.raises(ProtocolError, match="expected 350 nm to 750 nm"):
        planned(tmp_path, "monochromator", select={"monochromator": [900]})
    with pytest.raises(ProtocolError, match="needs a monochromator"):
        planned(tmp_path, "filters", select={"monochromator": [500]})
