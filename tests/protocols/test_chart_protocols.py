"""The protocols with a ColorChecker: their timelines, what they need, and bad input."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import read_rig_file
from labrig.foundation import resources
from labrig.protocols.camera_curves.protocol import CameraCurves
from labrig.protocols.colour_check.protocol import ColourCheck
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    written,
)


@pytest.mark.parametrize("name", ["camera_curves", "colour_check"])
def test_the_timeline_of_the_shipped_protocol_is_as_agreed(name: str) -> None:
    assert_timeline_as_agreed(name, "sim-chart")


def test_units_are_those_that_are_asked_for() -> None:
    def names(protocol: CameraCurves | ColourCheck) -> list[str]:
        return [unit.name for unit in protocol.units()]

    assert names(CameraCurves(card=False)) == ["dark", "chart", "put-back"]
    assert names(CameraCurves(through=True)) == [
        "dark", "card", "chart", "card-through", "put-back",
    ]  # fmt: skip
    assert names(ColourCheck(through="none")) == ["dark", "card", "chart", "put-back"]
    some = ColourCheck(through=(3, 19))
    assert names(some)[3:] == ["card-through", "patch-03", "patch-19", "put-back"]
    assert len(names(ColourCheck())) == 5 + 24


def test_the_filter_is_to_be_calibrated_where_it_is_used() -> None:
    rig = read_rig_file(resources.folder("config") / "sim-chart.yaml")
    assert CameraCurves(through=True).unmeasured(rig) == ["lvf_calibration"]
    assert ColourCheck().unmeasured(rig) == ["lvf_calibration"]
    assert not CameraCurves().unmeasured(rig)
    assert not ColourCheck(through="none").unmeasured(rig)


@pytest.mark.parametrize(
    ("protocol", "keys", "said"),
    [
        ("colour_check", {"through": [0]}, "through"),
        ("colour_check", {"through": [25]}, "through"),
        ("colour_check", {"through": [3, 3]}, "expected every patch once"),
        ("colour_check", {"thrugh": "all"}, "did you mean 'through'"),
        ("camera_curves", {"repeats": 0}, "repeats"),
        ("camera_curves", {"leave_out": [""]}, "leave_out"),
    ],
)
def test_an_impossible_key_is_one_clear_line(
    tmp_path: Path, protocol: str, keys: dict[str, Any], said: str
) -> None:
    assert_one_clear_line(written(tmp_path, protocol=protocol, **keys), said)
