"""The `simulation:` section: defaults that suffice, and mistakes that are named."""

import math
from pathlib import Path

import pytest

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml, read_model, validate, write_yaml
from labrig.sim.simulation import Simulation


def parsed(text: str) -> Simulation:
    return validate(parse_yaml(text, "rig.yaml"), Simulation, "rig.yaml")


def test_a_sample_is_enough() -> None:
    simulation = parsed("sample: blue-paint")
    (patch,) = simulation.patches
    assert patch.material == "blue-paint"
    assert patch.region == (0.1, 0.1, 0.8, 0.8)
    assert simulation.initial.lamp == "off"
    assert (simulation.sensor.width, simulation.sensor.height) == (1404, 936)
    assert simulation.epoch.isoformat() == "2026-01-01T00:00:00+00:00"


def test_everything_said() -> None:
    simulation = parsed(
        """
        sample:
          - {material: stickers, region: [0, 0, 0.5, 1], initial_charge: 0.8}
          - {material: bottle, region: [0.5, 0, 0.5, 1]}
        initial_charge: 0.3
        sensor: {width: 96, height: 64, flicker: 1 %}
        epoch: 2026-03-01T12:00:00Z
        seed: 7
        initial: {lamp: off, concentration: 0.1}
        faults: [lamp_dead]
        lamp: {irradiance: 2, warm_up: 5 min, warm_up_deficit: 5 %, drift_per_hour: 0.1 %}
        """
    )
    assert [patch.initial_charge for patch in simulation.patches] == [0.8, 0.3]
    assert simulation.lamp.warm_up == 300.0
    assert simulation.sensor.flicker == pytest.approx(0.01)


def test_written_and_read_is_the_same(tmp_path: Path) -> None:
    simulation = parsed("{sample: bottle, lamp: {warm_up: 90 s}, initial: {lamp: on}}")
    write_yaml(tmp_path / "simulation.yaml", simulation)
    assert read_model(tmp_path / "simulation.yaml", Simulation) == simulation


FAULTS = """
sample: bottle
epoch: 2026-01-01T00:00:00Z
faults:
  - lamp_dead
  - relays_unplugged: {at: 10 min, for: 20 s}
  - clock_ahead: {at: 5 min, by: 1 h}
  - clock_back: {at: 2 h, by: 10 min}
"""


def test_faults_have_names_and_times(tmp_path: Path) -> None:
    simulation = parsed(FAULTS)
    dead, unplugged, *_ = simulation.faults
    assert dead.lamp_dead is not None
    assert (dead.lamp_dead.at, dead.lamp_dead.until) == (0.0, math.inf)
    assert unplugged.relays_unplugged is not None
    assert [unplugged.relays_unplugged.is_on(t) for t in (599, 600, 619, 620)] == [
        False, True, True, False,
    ]  # fmt: skip
    write_yaml(tmp_path / "simulation.yaml", simulation)
    assert read_model(tmp_path / "simulation.yaml", Simulation) == simulation


def test_faults_keep_to_the_wall_when_a_room_is_opened_later() -> None:
    simulation = parsed(FAULTS)
    opened_s = simulation.epoch.timestamp()
    assert simulation.opened_at(opened_s - 10) is simulation
    assert simulation.wall_at_opening_s == opened_s
    later = simulation.opened_at(opened_s + 610)
    unplugged = later.faults[1].relays_unplugged
    assert unplugged is not None
    assert (unplugged.is_on(0.0), unplugged.is_on(10.0)) == (True, False)
    assert later.wall_at_opening_s == opened_s + 610 + 3600, "the PC's clock was put forward"
    assert simulation.opened_at(opened_s + 7200).wall_at_opening_s == opened_s + 7200 + 3000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sampel: blue-paint", "did you mean 'sample'?"),
        ("sample: []", "at least 1 value"),
        ("sample: [{materal: bottle}]", "did you mean 'material'?"),
        ("{sample: bottle, faults: [lamp_ded]}", "did you mean 'lamp_dead'?"),
        ("{sample: bottle, faults: [lamp_dead: {att: 5 s}]}", "did you mean 'at'?"),
        ("{sample: bottle, faults: [lamp_dead: {at: 5}]}", "a quantity with its unit"),
        ("{sample: bottle, faults: [{lamp_dead: , relay_dead: }]}", "one fault in each item"),
        (
            "{sample: bottle, faults: [disk_full: {at: 5 s, after_bytes: 3}]}",
            "expected 'at' or 'after_bytes', got both",
        ),
        (
            "{sample: bottle, faults: [camera_unplugged, camera_unplugged: {at: 5 s}]}",
            "comes out once",
        ),
        ("{sample: bottle, sensor: {width: 97}}", "expected an even number of pixels"),
        ("{sample: bottle, initial: {lamp: perhaps}}", "'off' or 'on', got 'perhaps'"),
        ("{sample: bottle, initial_charge: 1}", "less than 1, got '1'"),
        ("{sample: bottle, epoch: 2026-01-01T00:00:00}", "timezone"),
    ],
)
def test_mistakes_are_named(text: str, said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        parsed(text)
    assert said in str(refusal.value)


def test_the_manuals_harder_rooms_can_be_opened() -> None:
    page = Path(__file__).parents[2] / "docs" / "explanation" / "harder_rooms.md"
    blocks = page.read_text(encoding="utf-8").split("```yaml\n")[1:]
    rooms = [parse_yaml(block.partition("```")[0], str(page)) for block in blocks]
    assert len(rooms) == 2
    for room in rooms:
        assert isinstance(room, dict)
        simulation = validate(room["simulation"], Simulation, str(page))
        assert simulation != Simulation(sample=simulation.sample)
