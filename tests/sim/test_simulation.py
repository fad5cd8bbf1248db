"""The `simulation:` section: defaults that suffice, and mistakes that are named."""

from pathlib import Path

import pytest

from labrig.errors import UsageError
from labrig.yaml_file import parse_yaml, read_model, validate, write_yaml
from sim.simulation import Simulation


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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sampel: blue-paint", "did you mean 'sample'?"),
        ("sample: []", "at least 1 item"),
        ("sample: [{materal: bottle}]", "did you mean 'material'?"),
        ("{sample: bottle, faults: [lamp_ded]}", "did you mean 'lamp_dead'?"),
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
