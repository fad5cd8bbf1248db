"""The protocol led_fluorescence: its timeline, its order, and bad input."""

from pathlib import Path

import pytest
import yaml

from labrig import resources
from labrig.acquire import plan, read_protocol, read_rig_file
from labrig.errors import LabrigError, UsageError
from labrig.protocols.led_fluorescence import LedFluorescence

GOLDEN = Path(__file__).parent / "led_fluorescence.timeline.txt"


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    rig = resources.find("config", "rig", "sim-fluorescent")
    protocol = read_protocol(resources.find("protocols", "protocol", "led_fluorescence"))
    laid_out = plan(protocol, read_rig_file(rig), str(rig))
    assert "\n".join(laid_out.lines()) + "\n" == GOLDEN.read_text()


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
    path = tmp_path / "protocol.yaml"
    path.write_text(yaml.safe_dump({"protocol": "led_fluorescence"} | keys))
    with pytest.raises(UsageError, match=said) as caught:
        read_protocol(path)
    assert "\n" not in str(caught.value)


def test_an_led_that_the_rig_has_not_is_named_before_anything_moves(tmp_path: Path) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(yaml.safe_dump({"protocol": "led_fluorescence", "leds": ["470 nm"]}))
    rig = resources.find("config", "rig", "sim-fluorescent")
    with pytest.raises(LabrigError, match="470 nm"):
        plan(read_protocol(path), read_rig_file(rig), str(rig))
