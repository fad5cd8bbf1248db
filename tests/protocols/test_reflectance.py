"""Reflectance: timeline, refusals, and what a person is asked to do."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import read_protocol
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)
from tests.quick_yaml import write_quickly


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("reflectance", "sim-phosphor")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"charge": "-1 min"}, "charge"),
        ({"longest": "0 s"}, "longest"),
        ({"repeats": 0}, "repeats"),
        ({"lamp": "xenon"}, "lamp"),
        ({"patches": {"a": [0, 0, 1, 0.5], "b": [0, 0.4, 1, 0.5]}}, "one above the other"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    assert_one_clear_line(written(tmp_path, protocol="reflectance", **keys), said)


def test_a_lux_reading_is_a_number_with_its_sigma(tmp_path: Path) -> None:
    said = "expected 'illuminance_lux' beside its σ"
    assert_one_clear_line(written(tmp_path, protocol="irradiance", illuminance_lux_sigma=5), said)
    assert_one_clear_line(written(tmp_path, protocol="irradiance", illuminance_lux=0), "lux")


def test_a_written_protocol_reads_back_as_itself(tmp_path: Path) -> None:
    keys = {"charge": "2 min", "longest": "4 s", "patches": {"a": [0, 0.1, 1, 0.4]}}
    protocol = read_protocol(written(tmp_path, protocol="reflectance", **keys))
    again = tmp_path / "again.yaml"
    again.write_text(write_quickly(protocol.model_dump(mode="json", by_alias=True)))
    assert read_protocol(again) == protocol


def test_the_sample_lies_where_the_card_lay_and_all_is_put_back(tmp_path: Path) -> None:
    laid_out = planned(written(tmp_path, protocol="reflectance"), "sim-phosphor")
    steps = [(step.unit, step.action) for step in laid_out.steps if step.device == "person"]
    assert [unit for unit, _ in steps] == [
        "card-white-1", "card-white-1", "sample-white", "card-white-2",
        "card-narrow-1", "sample-narrow", "card-narrow-2", "put-back", "put-back",
    ]  # fmt: skip
    assert "grey card's place" in steps[2][1]
    # The glow is photographed with the door as it is.
    assert not any(step.device == "door" and "open" in step.action for step in laid_out.steps)
