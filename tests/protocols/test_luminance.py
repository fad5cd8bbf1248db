"""The luminance protocol: its timeline, what it refuses, and what it says of a standard."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import read_protocol, read_rig_file
from labrig.foundation.errors import UsageError
from labrig.protocols.luminance.protocol import PRESETS, Luminance
from tests.analyse.luminance_bench import write_rig
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)
from tests.quick_yaml import read_quickly, write_quickly

OWN = {"preset": "own", "time": "5 min"}


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("luminance", "sim-luminance")


def test_with_a_trap_door_the_card_comes_last(tmp_path: Path) -> None:
    content = read_quickly(write_rig(tmp_path).read_text())
    servo = {"driver": "maestro", "address": "sim://room/servo", "channel": 0,
             "closed": "1000 us", "open": "2000 us", "travel": "300 ms"}  # fmt: skip
    content["devices"]["door"] = servo
    (tmp_path / "rig.yaml").write_text(write_quickly(content))
    protocol = written(tmp_path, protocol="luminance", excitation=OWN)
    plan = planned(protocol, tmp_path / "rig.yaml")
    assert plan.units[-3:] == ("glow", "card", "put-back")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"excitation": {"preset": "DIN"}}, "excitation"),
        ({"excitation": {"preset": "DIN 67510-1", "time": "3 min"}}, "expected no 'time'"),
        ({"excitation": {"preset": "ASTM E2073", "time": "1 h"}}, "expected 'lamp'"),
        ({"excitation": {"preset": "own"}}, "expected 'time' with 'preset: own'"),
        ({"excitation": OWN | {"rested": 48}}, "with its unit"),
        ({"require": ["140 at 10 min"]}, "such as '140 mcd/m2 at 10 min'"),
        ({"class": "JE"}, "class"),
        ({"adaptation": "50 lx"}, "mcd/m2"),
        ({"until": "10 s"}, "leaves too little"),
        ({"emision": "blue-paint"}, "did you mean 'emission'?"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    assert_one_clear_line(written(tmp_path, protocol="luminance", **keys), said)


@pytest.mark.parametrize(
    ("reading", "said"),
    [
        ({"value": "312"}, "such as '312 lx'"),
        ({"value": "0 lx"}, "above 0"),
        ({"value": "nan lx"}, "such as '312 lx'"),
        ({"value": "95 cd/m2"}, "lx at the sample plane or cd/m2 at the card"),
        ({"sigma": "0 %"}, "sigma"),
        ({"lamp": "sun"}, "lamp"),
        ({"spectrum": "no-such-lamp"}, "no-such-lamp"),
        ({"sigmas": "3 %"}, "did you mean 'sigma'?"),
    ],
)
def test_a_reading_that_cannot_be_is_one_clear_line(
    tmp_path: Path, reading: dict[str, Any], said: str
) -> None:
    protocol = written(tmp_path, protocol="luminance", excitation=OWN)
    with pytest.raises(UsageError) as caught:
        planned(protocol, write_rig(tmp_path, reading))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"emission": "no-such-material"}, "no-such-material"),
        ({"emission": "missing.csv"}, "missing.csv"),
    ],
)
def test_a_plan_without_what_it_needs_is_refused(
    tmp_path: Path, keys: dict[str, Any], said: str
) -> None:
    protocol = written(tmp_path, protocol="luminance", excitation=OWN, **keys)
    with pytest.raises(UsageError, match=said):
        planned(protocol, "sim-luminance")
    with pytest.raises(UsageError, match="expected a reading of a luxmeter"):
        planned(written(tmp_path, protocol="luminance"), "sim-phosphor")


def test_a_written_protocol_reads_back_as_itself(tmp_path: Path) -> None:
    for keys in (
        {"excitation": {"preset": "JIS Z 9107", "rested": "50 h"}, "class": "JA"},
        {"excitation": OWN, "adaptation": "0.05 cd/m2", "require": ["3 mcd/m2 at 1 h"]},
    ):
        protocol = read_protocol(written(tmp_path, protocol="luminance", **keys))
        again = write_quickly(protocol.model_dump(mode="json", by_alias=True))
        (tmp_path / "again.yaml").write_text(again)
        assert read_protocol(tmp_path / "again.yaml") == protocol


def test_the_classes_of_jis_are_requirements() -> None:
    protocol = Luminance.model_validate({"class": "JB", "require": ["1 mcd/m2 at 2 h"]})
    least = {one.t_s: one.least_mcd_per_m2 for one in protocol.requirements}
    assert (least[600.0], least[3600.0], least[7200.0]) == (105.0, 15.0, 1.0)


@pytest.mark.parametrize(
    ("lamp", "lux", "charged_s", "rested_s", "deviations"),
    [
        ("xenon", 1000.0, 300.0, 48 * 3600.0, 0),
        ("xenon", 1040.0, 302.0, 90 * 3600.0, 0),
        ("halogen", 1000.0, 300.0, 48 * 3600.0, 1),
        ("xenon", 940.0, 300.0, 48 * 3600.0, 1),
        ("xenon", 1000.0, 330.0, 48 * 3600.0, 1),
        ("xenon", 1000.0, 300.0, None, 1),
        (None, 200.0, 1200.0, 3600.0, 4),
    ],
)
def test_deviations_from_din(
    lamp: Any, lux: float, charged_s: float, rested_s: float | None, deviations: int
) -> None:
    told = list(PRESETS["DIN 67510-1"].deviations(lamp, lux, charged_s, rested_s))
    assert len(told) == deviations


def test_the_plan_says_that_another_lamp_accords_with_no_standard(tmp_path: Path) -> None:
    protocol = read_protocol(written(tmp_path, protocol="luminance"))
    (note,) = protocol.notes(read_rig_file(write_rig(tmp_path, {"value": "500 lx"})))
    assert note.startswith("not according to DIN 67510-1:2020: halogen lamp, not xenon; 500 lx")
    own = read_protocol(written(tmp_path, protocol="luminance", excitation=OWN))
    assert own.notes(read_rig_file(write_rig(tmp_path))) == ()
