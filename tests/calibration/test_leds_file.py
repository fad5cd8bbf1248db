"""The LEDs' file: what is written comes back exactly; what does not fit is refused."""

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import RigFile, read_rig_file
from labrig.bench_optics import led_sources
from labrig.calibration import LEDS_KIND, LedsFile
from labrig.fit.fluorescence import Exposure
from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import yaml_text

UNKNOWN = {"brightness": None, "brightness_sigma": None}


def led(**changed: Any) -> dict[str, Any]:
    return {
        "wavelength_nm": [440.0, 450.0, 460.0],
        "value": [0.0, 1.0, 0.1],
        "sigma": [0.01, 0.02, 0.01],
        "brightness": 0.8,
        "brightness_sigma": 0.02,
        "wavelength_sigma_nm": 0.2,
        "source": "spectrometer",
    } | changed


def content(of: dict[str, Any] | None = None, **changed: Any) -> dict[str, Any]:
    return {"leds": {"455 nm": of or led()}, "scale": "relative", "uv_scale": "none"} | changed


def bench() -> RigFile:
    return read_rig_file(resources.find("config", "rig", "sim-fluorescent"))


@given(
    values=st.tuples(*[st.floats(1e-12, 1.0)] * 3),
    brightness=st.floats(1e-9, 1e9),
    sigma=st.floats(0.0, 1e9),
)
def test_what_is_written_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    values: tuple[float, float, float],
    brightness: float,
    sigma: float,
) -> None:
    of = led(value=values, brightness=brightness, brightness_sigma=sigma)
    file = LedsFile.model_validate(content(of))
    folder = tmp_path_factory.mktemp("leds")
    LEDS_KIND.write(folder, file)
    assert LEDS_KIND.read(folder / "leds.yaml") == file


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (content(led(wavelength_nm=[440.0, 460.0, 450.0])), "rising numbers in 'wavelength_nm'"),
        (content(led(value=[0.0, 1.0])), "expected 3 numbers in 'value' and 'sigma'"),
        (content(led(value=[0.0, 0.0, 0.0])), "expected light in 'value'"),
        (content(led(brightness=None)), "'brightness' and 'brightness_sigma' together"),
        (content(led(brightness=0.0)), "brightness"),
        (content(uv_scale="unkown"), "uv_scale"),
        (content(uv_scael="none"), "did you mean 'uv_scale'"),
        (content() | {"leds": {}}, "leds"),
    ],
)
def test_a_malformed_file_is_one_line(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    path = tmp_path / "leds.yaml"
    path.write_text(yaml_text(changed))
    with pytest.raises(UsageError, match=said) as caught:
        LEDS_KIND.read(path)
    assert "\n" not in str(caught.value)


def test_lights_for_a_fit_are_as_calibrated_else_by_the_rig_file() -> None:
    leds = {"455 nm": led(), "365 nm": led(**UNKNOWN)}
    file = LedsFile.model_validate(content(leds=leds, uv_scale="unknown"))
    exposures = led_sources(bench(), "the rig", file)
    assert list(exposures) == list(led_sources(bench(), "the rig"))
    blue, ultraviolet, green = (exposures[name] for name in ("455 nm", "365 nm", "530 nm"))
    assert (blue.brightness, blue.brightness_sigma, blue.wavelength_sigma_nm) == (0.8, 0.02, 0.2)
    assert blue.light.at([450.0, 455.0]) == pytest.approx([1.0, 0.55])
    assert (ultraviolet.brightness, ultraviolet.brightness_sigma) == (1.0, math.inf)
    assert ultraviolet.wavelength_sigma_nm == 0.2
    assert (green.brightness, green.brightness_sigma) == (1.0, math.inf)
    assert green.light.at([530.0, 545.5]) == pytest.approx([1.0, 0.5], abs=0.01)
    for one in exposures.values():
        Exposure(one.light, one.brightness, one.brightness_sigma, one.wavelength_sigma_nm)


def test_a_calibration_of_other_leds_is_one_line() -> None:
    file = LedsFile.model_validate(content(leds={"940 nm": led()}))
    with pytest.raises(UsageError, match=r"has '940 nm', the rig has 365 nm, .*run led_brightness"):
        led_sources(bench(), "the rig", file)
    lamp_only = read_rig_file(resources.find("config", "rig", "sim"))
    with pytest.raises(UsageError, match="expected LEDs under 'devices'"):
        led_sources(lamp_only, "the rig")


def test_nothing_known_of_a_light_is_one_line() -> None:
    rig = bench()
    devices = rig.model_dump(mode="json")["devices"]
    devices["leds"]["channels"] = {"blue": {"output": 1}}
    bare = RigFile.model_validate({"name": "bare", "devices": {"leds": devices["leds"]}})
    with pytest.raises(UsageError, match="light of LED 'blue'; give its 'centre' and 'fwhm'"):
        led_sources(bare, "the rig")
