"""The protocol validate_illuminants: its timeline, the chart, and bad input."""

from pathlib import Path

import pytest

from labrig.acquire import read_protocol
from labrig.foundation.errors import LabrigError
from labrig.protocols.validate_illuminants.protocol import ValidateIlluminants
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("validate_illuminants", "sim-fluorescent")


def test_the_chart_is_photographed_under_the_lamp_of_the_white_balance() -> None:
    with_chart = ValidateIlluminants(chart=True, balance="xenon", lamps=("halogen", "xenon"))
    names = [unit.name for unit in with_chart.units()]
    assert names == [
        "dark", "card halogen", "card xenon", "chart xenon", "sample halogen", "sample xenon",
        "put-back",
    ]  # fmt: skip
    assert ValidateIlluminants().balanced == "daylight"


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"lamps": []}, "lamps"),
        ({"lamps": ["xenon", "xenon"]}, "expected every lamp once"),
        ({"balance": "sun"}, "expected 'balance' to be one of 'lamps'"),
        (
            {"fluorescence": {"other": "white-paper"}},
            "for each patch, got none for 'sample'",
        ),
        ({"exposures": 9}, "exposures"),
    ],
)
def test_an_impossible_key_is_one_clear_line(
    tmp_path: Path, keys: dict[str, object], said: str
) -> None:
    assert_one_clear_line(written(tmp_path, protocol="validate_illuminants", **keys), said)


def test_a_lamp_that_the_rig_has_not_is_named_before_anything_moves(tmp_path: Path) -> None:
    path = written(tmp_path, protocol="validate_illuminants", lamps=["xeonn"])
    with pytest.raises(LabrigError, match=r"a lamp 'xeonn', which the rig has not: .*xenon"):
        planned(path, "sim-fluorescent")


def test_a_run_beside_the_protocol_is_found_from_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "runs" / "measured").mkdir(parents=True)
    path = tmp_path / "protocol.yaml"
    path.write_text("protocol: validate_illuminants\nfluorescence: ./runs/measured\n")
    protocol = read_protocol(path)
    assert isinstance(protocol, ValidateIlluminants)
    assert Path(str(protocol.fluorescence)) == tmp_path / "runs" / "measured"
