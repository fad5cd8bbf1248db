"""The protocol led_fluorescence: its timeline, its order, and bad input."""

from pathlib import Path

import pytest

from labrig.foundation.errors import LabrigError
from labrig.protocols.led_fluorescence.protocol import LedFluorescence
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("led_fluorescence", "sim-fluorescent")


def test_the_order_is_shuffled_by_its_seed_and_the_first_led_comes_last_again() -> None:
    first, same, other = (LedFluorescence(order_seed=seed) for seed in (1, 1, 2))
    assert first.shuffled() == same.shuffled() != other.shuffled()
    assert sorted(first.shuffled()) == sorted(first.leds)
    names = [unit.name for unit in first.units()]
    assert names[-2] == f"again {first.shuffled()[0]}"
    assert [f"card {led}" in names and f"sample {led}" in names for led in first.leds] == [True] * 9


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"leds": []}, "leds"),
        ({"leds": ["455 nm", "455 nm"]}, "expected every LED once"),
        ({"exposures": 9}, "exposures"),
        ({"patches": {}}, "patches"),
        ({"longest": "0 s"}, "longest"),
    ],
)
def test_an_impossible_key_is_one_clear_line(
    tmp_path: Path, keys: dict[str, object], said: str
) -> None:
    assert_one_clear_line(written(tmp_path, protocol="led_fluorescence", **keys), said)


def test_an_led_that_the_rig_has_not_is_named_before_anything_moves(tmp_path: Path) -> None:
    path = written(tmp_path, protocol="led_fluorescence", leds=["470 nm"])
    with pytest.raises(LabrigError, match="470 nm"):
        planned(path, "sim-fluorescent")
