"""`simulation.camera` of a rig file: which body, and how somebody has set it."""

import pytest

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml, validate
from labrig.sim.camera import BodySettings
from labrig.sim.simulation import Simulation


def parsed(text: str) -> BodySettings:
    content = parse_yaml(f"{{sample: bottle, camera: {text}}}", "rig.yaml")
    return validate(content, Simulation, "rig.yaml, simulation").camera


def test_nothing_said_is_an_eos_set_with_care() -> None:
    assert validate({"sample": "bottle"}, Simulation, "rig.yaml").camera == parsed("{body: eos}")
    assert parsed("{}").exposure_mode == "M"


def test_everything_said() -> None:
    settings = parsed(
        "{body: eos, exposure_mode: Av, autofocus: true, iso: auto, auto_power_off: 1 min, "
        "long_exposure_noise_reduction: true, highlight_tone_priority: true, mirror_lock_up: true}"
    )
    assert (settings.iso, settings.auto_power_off) == ("auto", 60.0)
    assert settings == BodySettings.model_validate(settings.model_dump())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{autofocos: true}", "did you mean 'autofocus'?"),
        ("{body: nikon}", "'eos' or 'standard'"),
        ("{exposure_mode: N}", "'P', 'Tv', 'Av', 'M' or 'B'"),
        ("{iso: 123}", "thirds of a stop"),
        ("{auto_power_off: 60}", "'60 min'"),
        ("{body: standard, mirror_lock_up: true}", "'body: eos' with mirror_lock_up"),
    ],
)
def test_mistakes_are_named(text: str, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        parsed(text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
