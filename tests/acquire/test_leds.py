"""The role `leds`: lit by a protocol on a simulated bench, planned, read back, checked, guarded."""

import copy
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    LEDS,
    LEDS_OFF,
    LIGHTS,
    LedLight,
    LedSwitch,
    ProtocolModel,
    Rig,
    Session,
    Unit,
    at,
    bank_lights,
    lights_that_read_back,
    plan,
    planned_rig,
    read_rig_file,
    run_units,
)
from labrig.acquire.roles.light_bank import PlannedLightBank
from labrig.bench import open_bench
from labrig.bench.guard import guarding
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, ProtocolError, UsageError
from labrig.record import RunFolder
from labrig.sim.lamp import WAVELENGTH_NM
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

from .fakes import Watching

Make = Callable[..., Path]
BANK = {"450 nm": 1, "525 nm": 2}


@pytest.fixture
def rig(make_rig: Make) -> Path:
    """The simulated rig with two LEDs on the lamp's board."""
    path = make_rig(
        leds=[{"relay": 1, "centre": 450}, {"relay": 2, "centre": 525}],
    )
    content = read_quickly(path.read_text())
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    content["devices"]["leds"] = {
        "driver": "numato", "address": "sim://room/relays", "channels": BANK,
    }  # fmt: skip
    path.write_text(write_quickly(content))
    return path


class Colours(ProtocolModel):
    """One LED after the other."""

    channels: tuple[str, ...] = tuple(BANK)

    def units(self) -> Sequence[Unit]:
        return [ColoursUnit(self.channels)]


class ColoursUnit:
    name = "colours"

    def __init__(self, channels: tuple[str, ...]) -> None:
        self.channels = channels

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.perform(LAMP_OFF)
        for channel in self.channels:
            session.perform(LedSwitch(channel))
            session.wait(100.0, "charging")
        session.run_sequence([at(0.0, LEDS_OFF)])


def test_what_protocols_do_with_them_is_lit_recorded_and_read_back(
    rig: Path, tmp_path: Path
) -> None:
    folder = RunFolder.create(tmp_path / "runs", "colours", 0.0, {}, seed=1)
    with folder, open_bench(read_rig_file(rig), str(rig)) as bench, bench.devices() as devices:
        assert lights_that_read_back(devices) == {"lamp": True, "leds": True}
        run_units(Colours(protocol="colours").units(), devices, folder, Watching(), {})
        assert bench.room is not None
        states = bench.room.room.leds.states
        (attempt,) = folder.read().completed().values()
    assert [channel_on for _, channel_on in states] == [set(), {1}, set(), {2}, set()]
    assert [(one.device, one.action) for one in attempt.actions] == [
        ("lamp", "on"), ("lamp", "off"),
        ("leds", "450 nm on"), ("leds", "525 nm on"), ("leds", "off"),
    ]  # fmt: skip
    on, _, off = attempt.actions[2:]
    assert on.end_time - on.start_time < 0.02, "nothing is switched off that is known to be off"
    assert off.end_time - off.start_time < 0.02


def test_they_are_planned(rig: Path) -> None:
    lines = plan(Colours(protocol="colours"), read_rig_file(rig), str(rig)).lines()
    assert [line.split("s)  ")[1].split() for line in lines if " leds " in line] == [
        ["leds", "450", "nm", "on"], ["leds", "525", "nm", "on"], ["leds", "off"],
    ]  # fmt: skip
    with pytest.raises(ProtocolError, match="an LED '540 nm', which the rig has not") as caught:
        plan(Colours(protocol="colours", channels=("540 nm",)), read_rig_file(rig), str(rig))
    assert "it has 450 nm, 525 nm; name one of these in 'leds:'" in str(caught.value)


def test_a_rig_without_them_is_reported_so(make_rig: Make) -> None:
    path = make_rig()
    with pytest.raises(ProtocolError, match=r"needs a bank of LEDs, .* has none"):
        plan(Colours(protocol="colours"), read_rig_file(path), str(path))


def test_another_driver_does_not_do(rig: Path) -> None:
    content = read_quickly(rig.read_text(encoding="utf-8"))
    content["devices"]["leds"]["driver"] = "maestro"
    rig.write_text(write_quickly(content), encoding="utf-8")
    with pytest.raises(UsageError, match="'maestro' is no bank of LEDs"):
        plan(Colours(protocol="colours"), read_rig_file(rig), str(rig))


class Shared(PlannedLightBank):
    """Somebody else switches it off after 30 s."""

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__({name: LedLight() for name in BANK})
        self._clock = clock

    def reads_back(self) -> bool:
        return True

    def channel_on(self) -> str | None:
        return None if self._clock.now() > 30.0 else super().channel_on()


class Unlit:
    name = "unlit"

    def run(self, session: Session) -> None:
        session.perform(LedSwitch("450 nm"))
        session.wait(600.0, "charging")


def test_what_somebody_else_switched_ends_the_unit(tmp_path: Path) -> None:
    clock = VirtualClock()
    folder = RunFolder.create(tmp_path, "unlit", 0.0, {}, seed=1)
    bench = Rig("bench", clock, {"leds": Shared(clock)}, {})
    with folder, pytest.raises(DeviceError, match="something else has switched it") as caught:
        run_units([Unlit()], bench, folder, Watching(), {})
    assert "the bank of LEDs was switched 450 nm on 1 min ago and reads off" in str(caught.value)
    assert clock.now() == pytest.approx(60.0, abs=1.0)
    assert bench[LEDS].channel_on() is None


def test_the_rig_check_lights_each(rig: Path, labrig: Callable[..., Ended]) -> None:
    ended = labrig("rig", "check", rig, "--json")
    report: dict[str, Any] = json.loads(ended.out)
    assert (ended.code, report["failures"], report["unsafe"]) == (0, [], None)
    (leds,) = [device for device in report["devices"] if device["key"] == "leds"]
    assert [one["what"] for one in leds["measured"]] == [
        "450 nm on, read back", "525 nm on, read back", "off, read back",
    ]  # fmt: skip
    assert "LEDs 450 nm on relay 1" in leds["identity"]


def thorlabs(make_rig: Make) -> Path:
    """Five LEDs on two Thorlabs units, and the lamp on its own board."""
    path = make_rig(
        leds=[{"relay": 1 + n, "centre": 400 + 50 * n, "fwhm": 20} for n in range(5)],
        led_board="dc4100",
    )
    content = read_quickly(path.read_text())
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    channels: dict[str, dict[str, Any]] = {
        f"{400 + 50 * n} nm": {"output": n % 4 + 1, "centre": 400 + 50 * n, "fwhm": 20}
        for n in range(5)
    }
    channels["400 nm"] |= {"brightness": "30 %", "settling": "0.5 s"}
    channels["600 nm"]["address"] = "sim://room/dc4100-2"
    content["devices"]["leds"] = {
        "driver": "thorlabs_dc4100", "address": "sim://room/dc4100-1", "channels": channels,
    }  # fmt: skip
    path.write_text(write_quickly(content))
    return path


def test_a_bank_over_two_units_lights_the_room(make_rig: Make) -> None:
    path = thorlabs(make_rig)
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
        assert bench.room is not None
        light = {}
        for name in devices[LEDS].channels():
            devices[LEDS].light(name)
            bench.clock.sleep(1.0)
            light[name] = bench.room.room.leds.irradiance(bench.clock.now())
        devices[LEDS].dark()
        at = bench.clock.now()
        assert not bench.room.room.leds.irradiance(at).any()
    ratio = light["400 nm"].sum() / light["450 nm"].sum()
    assert ratio == pytest.approx(0.3, rel=0.01)
    peaks_nm = [WAVELENGTH_NM[spectrum.argmax()] for spectrum in light.values()]
    assert peaks_nm == pytest.approx([400, 450, 500, 550, 600], abs=2.5)


@pytest.mark.parametrize("answers", ["nothing", "text", "bytes"])
def test_eight_relays_of_an_lcus_board_light_the_room(make_rig: Make, answers: str) -> None:
    path = make_rig(
        leds=[{"relay": 1 + n, "centre": 400 + 30 * n, "fwhm": 20} for n in range(8)],
        led_board="lcus",
        lcus=answers,
    )
    content = read_quickly(path.read_text())
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"leds": [5]}}
    channels = {f"{400 + 30 * n} nm": n + 1 for n in range(8)}
    content["devices"]["leds"] = {
        "driver": "lcus", "address": "sim://room/lcus", "channels": channels,
    }  # fmt: skip
    path.write_text(write_quickly(content))
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
        assert bench.room is not None
        assert lights_that_read_back(devices)["leds"] == (answers != "nothing")
        for name in channels:
            devices[LEDS].light(name)
            assert devices[LEDS].channel_on() == name
        devices[LEDS].dark()
        states = [lit for _, lit in bench.room.room.leds.states]
    lit_in_turn = [lit for number in range(1, 9) for lit in ({number}, set())]
    assert states == [set(), {5}, set(), *lit_in_turn]


def test_the_rig_check_lists_heads_and_settling(
    make_rig: Make, labrig: Callable[..., Ended]
) -> None:
    ended = labrig("rig", "check", thorlabs(make_rig), "--json")
    report: dict[str, Any] = json.loads(ended.out)
    assert (ended.code, report["failures"]) == (0, [])
    (leds,) = [device for device in report["devices"] if device["key"] == "leds"]
    said = {one["what"]: one["value"] for one in leds["measured"]}
    assert said["400 nm settles, from the rig file"] == "500 ms, for which protocols wait"
    assert "600 nm on, read back" in said
    assert "serial M00100002, firmware 1.5.0, LEDs 600 nm on output 1 at 100 %" in leds["identity"]
    assert leds["findings"][0]["severity"] == "fine"


def test_all_addresses_of_a_bank_are_known(make_rig: Make) -> None:
    entry = read_rig_file(thorlabs(make_rig)).devices["leds"]
    assert entry.addresses() == ["sim://room/dc4100-1", "sim://room/dc4100-2"]


BANKS: dict[str, dict[str, Any]] = {
    "numato": {"channels": {"a": {"relay": 1}, "b": 2}},
    "serial_relay": {
        "channels": {"a": {"on": "on 1", "off": "off 1"}, "b": {"on": "on 2", "off": "off 2"}}
    },
    "thorlabs_dc4100": {"channels": {"a": {"output": 1}, "b": {"output": 2}}},
}


@pytest.mark.parametrize("driver", BANKS)
def test_every_bank_says_what_is_known_of_its_light(driver: str, tmp_path: Path) -> None:
    (tmp_path / "measured.csv").write_text("wavelength_nm,value\n440,0\n447,2\n470,0\n")
    light = {"spectrum": "measured.csv", "settling": "0.5 s"}
    keys: dict[str, Any] = copy.deepcopy(BANKS[driver])
    (leds,) = keys.values()
    content = {
        "name": "bench",
        "devices": {"leds": {"driver": driver, "address": "COM3", **keys}},
    }
    leds["a"] |= light
    path = tmp_path / "rig.yaml"
    path.write_text(write_quickly(content))
    lights = bank_lights(read_rig_file(path), LEDS.key, str(path))
    assert [led.settling for led in lights.values()] == [0.5, 0.0]
    assert lights["a"].peak_nm() == 447
    assert lights["b"].relative_spectrum() is None
    planned = planned_rig(read_rig_file(path), str(path))
    assert [planned[LEDS].settling_s(name) for name in "ab"] == [0.5, 0.0]
    (tmp_path / "measured.csv").unlink()
    with pytest.raises(UsageError, match=r"measured\.csv"):
        planned_rig(read_rig_file(path), str(path))
    leds["a"] |= {"centre": 450, "fwhm": 20}
    path.write_text(write_quickly(content))
    with pytest.raises(UsageError, match="expected 'spectrum', or 'centre' and 'fwhm'"):
        bank_lights(read_rig_file(path), LEDS.key, str(path))


def test_a_rig_without_leds_has_no_light_of_them(make_rig: Make) -> None:
    assert bank_lights(read_rig_file(make_rig()), LEDS.key, "rig.yaml") == {}


def test_a_band_has_its_width() -> None:
    spectrum = LedLight(centre=523.0, fwhm=31.0).relative_spectrum()
    assert spectrum is not None
    above = spectrum.wavelength_nm[spectrum.value >= 0.5]
    assert above[-1] - above[0] == pytest.approx(31.0, abs=31 / 20)
    assert spectrum.value[[0, -1]] == pytest.approx(0.0, abs=1e-6)


def test_the_guard_watches_them() -> None:
    assert {"lamp", "leds", "illuminants"} == LIGHTS


def test_a_rig_with_leds_only_is_guarded(rig: Path) -> None:
    content = read_quickly(rig.read_text(encoding="utf-8"))
    del content["devices"]["lamp"]
    content |= {"simulation": None}
    rig.write_text(write_quickly(content), encoding="utf-8")
    with guarding(read_rig_file(rig), str(rig)) as guard:
        assert guard is not None
        assert guard.lights == {"leds"}
