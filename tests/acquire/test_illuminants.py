"""The role `illuminants`: one lamp at a time, read back, planned; what is known of its light."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.acquire import (
    ILLUMINANTS,
    ILLUMINANTS_OFF,
    Illuminant,
    IlluminantSwitch,
    ProtocolModel,
    Session,
    Unit,
    bank_lights,
    lights_that_read_back,
    plan,
    read_rig_file,
    run_units,
)
from labrig.bench import open_bench
from labrig.bench_optics import illuminant_sources
from labrig.foundation.errors import ProtocolError, UsageError
from labrig.optics import read_light
from labrig.record import RunFolder
from tests.quick_yaml import read_quickly, write_quickly

from .fakes import Watching

Make = Callable[..., Path]
LAMPS: dict[str, dict[str, Any]] = {
    "day": {"relay": 0, "spectrum": "D65", "settling": "30 s"},
    "warm": {"relay": 2, "spectrum": "halogen_3000k", "filter": "neutral-50"},
    "black light": {"relay": 5, "centre": 365, "fwhm": 15},
}


@pytest.fixture
def rig(make_rig: Make) -> Path:
    """The simulated rig with a bank of three lamps."""
    path = make_rig()
    content = read_quickly(path.read_text())
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    kinds = {0: "daylight", 2: "halogen", 5: "ultraviolet"}
    content["simulation"]["illuminants"] = [
        {"relay": relay, "kind": kind} for relay, kind in kinds.items()
    ]
    content["devices"]["illuminants"] = {
        "driver": "numato", "address": "sim://room/lamps", "channels": LAMPS,
    }  # fmt: skip
    path.write_text(write_quickly(content))
    return path


class Lit(ProtocolModel):
    lamps: tuple[str, ...] = ("warm", "day")

    def units(self) -> Sequence[Unit]:
        return [LitUnit(self.lamps)]


class LitUnit:
    name = "lit"

    def __init__(self, lamps: tuple[str, ...]) -> None:
        self.lamps = lamps

    def run(self, session: Session) -> None:
        for lamp in self.lamps:
            session.perform(IlluminantSwitch(lamp))
            session.wait(10.0, "it shines")
        session.perform(ILLUMINANTS_OFF)


def test_one_is_lit_at_a_time_recorded_and_read_back(rig: Path, tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "runs", "lit", 0.0, {}, seed=1)
    with folder, open_bench(read_rig_file(rig), str(rig)) as bench, bench.devices() as devices:
        assert lights_that_read_back(devices) == {"lamp": True, "illuminants": True}
        run_units(Lit(protocol="lit").units(), devices, folder, Watching(), {})
        assert bench.room is not None
        states = bench.room.room.illuminants.states
        (attempt,) = folder.read().completed().values()
    assert [lit for _, lit in states] == [set(), {2}, set(), {0}, set()]
    assert [(one.device, one.action) for one in attempt.actions] == [
        ("illuminants", "warm on"), ("illuminants", "day on"), ("illuminants", "off"),
    ]  # fmt: skip


def test_a_lamp_that_is_not_there_and_another_driver_are_named(rig: Path) -> None:
    with pytest.raises(ProtocolError, match=r"a lamp 'dya', which the rig has not: .* day, "):
        plan(Lit(protocol="lit", lamps=("dya",)), read_rig_file(rig), str(rig))
    rig.write_text(
        rig.read_text(encoding="utf-8").replace("numato", "maestro"),
        encoding="utf-8",
    )
    with pytest.raises(UsageError, match="'maestro' is no bank of lamps"):
        plan(Lit(protocol="lit"), read_rig_file(rig), str(rig))


@pytest.mark.parametrize(
    ("key", "driver", "keys", "said"),
    [
        ("illuminants", "maestro", {"channels": {"day": 0}}, "is no bank of lamps"),
        ("leds", "thorlabs_fw102c", {"channels": LAMPS}, "is no bank of LEDs"),
    ],
)
def test_a_board_without_switches_is_refused(
    rig: Path, key: str, driver: str, keys: dict[str, Any], said: str
) -> None:
    content = read_quickly(rig.read_text(encoding="utf-8"))
    content["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
    content["devices"][key] = {"driver": driver, "address": "COM3"} | keys
    rig.write_text(write_quickly(content), encoding="utf-8")
    with pytest.raises(UsageError, match=f"the driver '{driver}' {said}") as caught:
        plan(Lit(protocol="lit"), read_rig_file(rig), str(rig))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("lamps", "said"),
    [
        ({"a": {"relay": 1, "spectrum": "D65"}, "b": {"relay": 1}}, "a relay of its own"),
        ({"a": {"relay": 1, "spectrum": "D65", "centre": 400, "fwhm": 10}}, "got both"),
        ({"a": {"relay": 1, "settling": "3 h"}}, "settling"),
    ],
)
def test_bad_keys_of_a_bank_are_one_clear_line(rig: Path, lamps: object, said: str) -> None:
    content = read_quickly(rig.read_text(encoding="utf-8"))
    content["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
    content["devices"]["illuminants"]["channels"] = lamps
    rig.write_text(write_quickly(content), encoding="utf-8")
    with pytest.raises(UsageError, match=said) as caught:
        plan(Lit(protocol="lit", lamps=("a",)), read_rig_file(rig), str(rig))
    assert "\n" not in str(caught.value)


def test_the_light_is_that_of_file_illuminant_or_band_behind_its_filter(rig: Path) -> None:
    file = read_rig_file(rig)
    assert set(bank_lights(file, ILLUMINANTS.key, str(rig))) == set(LAMPS)
    lights = illuminant_sources(file, str(rig))
    nm = [450.0, 600.0]
    np.testing.assert_allclose(lights["day"].light.at(nm), read_light("D65").at(nm))
    bare = Illuminant(spectrum="halogen_3000k").relative_spectrum()
    assert bare is not None
    passed = lights["warm"].light.at(nm) / bare.at(nm)
    assert ((passed > 0.4) & (passed < 0.6)).all()
    black = lights["black light"]
    assert black.light.wavelength_nm[black.light.value.argmax()] == 365
    assert black.wavelength_sigma_nm > lights["day"].wavelength_sigma_nm == 0


def test_nothing_known_of_a_lamp_and_no_bank_are_one_clear_line(rig: Path, make_rig: Make) -> None:
    content = read_quickly(rig.read_text(encoding="utf-8"))
    content["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
    content["devices"]["illuminants"]["channels"] = {"dim": {"relay": 1}}
    rig.write_text(write_quickly(content), encoding="utf-8")
    with pytest.raises(UsageError, match="nothing is known of the light of lamp 'dim'"):
        illuminant_sources(read_rig_file(rig), str(rig))
    without = make_rig()
    with pytest.raises(UsageError, match="expected 'illuminants' under 'devices'"):
        illuminant_sources(read_rig_file(without), str(without))
