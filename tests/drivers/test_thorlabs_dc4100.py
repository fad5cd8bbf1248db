"""LED heads on Thorlabs DC4100: wire transcripts, and the emulated units, whatever happens."""

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st
from pydantic import ValidationError

from labrig.acquire import LightBank, load_driver
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, DeviceLostError, UnclearAnswerError, UsageError
from labrig.sim.boards import Dc4100Board
from tests.drivers.serial_wire import BoardPort, InterruptingClock, Script, ScriptedPort, Wired

ThorlabsLeds: Any = load_driver("leds", "thorlabs_dc4100", "rig.yaml")

CHANNELS: dict[str, Any] = {
    "455 nm": {"output": 1, "brightness": "60 %", "centre": 455, "fwhm": 18, "settling": "0.5 s"},
    "530 nm": {"output": 4},
}
NO_ERROR = (b"e?\r\n", b"ERROR 0:No error\r\n")
SYNC: Script = [(b"\r\n", b""), NO_ERROR]


def asked(query: str, answer: str) -> Script:
    return [(f"{query}\r\n".encode(), f"{answer}\r\n".encode())]


def told(command: str) -> Script:
    return [(f"{command}\r\n".encode(), b""), NO_ERROR]


def off(output: int) -> Script:
    return [*told(f"o {output} 0"), *asked(f"o? {output}", "0")]


NAMED = [*SYNC, *asked("n?", "DC4100"), *asked("s?", "M00272310")]
ALL_OFF = [*off(0), *off(1), *off(2), *off(3)]
IDENTIFIED = [*NAMED, *ALL_OFF]
MODES = [*told("m 1"), *asked("m?", "1"), *told("sm 1"), *asked("sm?", "1")]
HEADS = [*asked("wl? 0", "455"), *asked("wl? 3", "530")]
OPENED = [*IDENTIFIED, *MODES, *HEADS]


def lit(output: int, per_cent: int, status: str = "0", state: str = "1") -> Script:
    return [
        *told(f"bp {output} {per_cent}"), *asked(f"bp? {output}", str(per_cent)),
        *told(f"o {output} 1"), *asked("r?", status), *asked(f"o? {output}", state),
    ]  # fmt: skip


def bank(script: Script, **keys: Any) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, list(script))
    content = {"channels": CHANNELS} | keys
    chosen = ThorlabsLeds.Settings.model_validate(content)
    return ThorlabsLeds("COM7", chosen, Wired(clock, port)), port


class Heads:
    """LED heads on the outputs of a unit, and the most of them that were ever lit at once."""

    def __init__(self) -> None:
        self.lit: dict[int, bool] = {}
        self.fractions: dict[int, float] = {}
        self.most = 0

    def switch(self, output: int, on: bool) -> None:
        self.lit[output] = on
        self.most = max(self.most, sum(self.lit.values()))

    def dim(self, output: int, fraction: float) -> None:
        self.fractions[output] = fraction


class Units(Wired):
    """Connections with a unit at each of some addresses."""

    def __init__(self, clock: VirtualClock, units: dict[str, Dc4100Board]) -> None:
        self.clock = clock
        self._ports = {address: BoardPort(clock, unit) for address, unit in units.items()}

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> ScriptedPort:
        assert (baudrate, framing) == (115200, "8N1")
        return self._ports[address]


def test_it_is_identified_darkened_and_set_before_one_is_lit() -> None:
    driver, port = bank(
        [
            *OPENED,
            *lit(0, 60),
            *off(0), *lit(3, 100),
            *asked("o? 0", "0"), *asked("o? 3", "1"),
            *off(3),
            *asked("v?", "1.5.0"),
            *HEADS,
            *SYNC, *ALL_OFF,
        ]
    )  # fmt: skip
    assert issubclass(ThorlabsLeds, LightBank)
    assert driver.channels() == tuple(CHANNELS)
    assert driver.reads_back()
    assert [driver.settling_s(name) for name in CHANNELS] == [0.5, 0.0]
    driver.light("455 nm")
    driver.light("530 nm")
    assert driver.channel_on() == "530 nm"
    driver.dark()
    assert driver.identity() == (
        "Thorlabs DC4100, serial M00272310, firmware 1.5.0, LEDs 455 nm on output 1 at 60 %, "
        "530 nm on output 4 at 100 %"
    )
    (finding,) = driver.findings()
    assert finding.severity == "fine"
    driver.make_safe()
    assert port.script == []


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (0x2, "its supply voltage is out of range"),
        (0x8, "it is too hot"),
        (0x20, "output 1 of the DC4100 at COM7 reports a fault: no LED head is connected"),
        (0x2000, "output 1 .* its LED is open"),
        (0x200000, "output 1 .* has reached its current limit at 60 %"),
    ],
)
def test_faults_in_the_status_word_are_told_in_words(status: int, said: str) -> None:
    driver, _ = bank([*OPENED, *lit(0, 60, str(status), "0")])
    with pytest.raises(DeviceError, match=said) as caught:
        driver.light("455 nm")
    assert "\n" not in str(caught.value)


def test_faults_of_other_outputs_are_none_of_this_one() -> None:
    others = sum(0x20 << 2 * output for output in (1, 2)) | 0x80000
    driver, port = bank([*OPENED, *lit(0, 60, str(others))])
    driver.light("455 nm")
    assert port.script == []


def test_the_limit_is_where_full_brightness_is_meant_to_be() -> None:
    at_limit = 0x200000 << 6
    driver, port = bank([*OPENED, *lit(3, 100, f"{at_limit:012d}")])
    driver.light("530 nm")
    assert port.script == []


def test_an_error_of_before_is_none_of_this_one() -> None:
    stale = [(b"\r\n", b"ERROR 12:Invalid command\r\n"), (b"e?\r\n", b"ERROR 12:Invalid\r\n")]
    _, port = bank([*stale, *OPENED[2:]])
    assert port.script == []


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ([*SYNC, *asked("n?", "DC2200")], "expected DC4100 or DC4104, got 'DC2200'"),
        ([*SYNC, *asked("n?", "DC4104"), *asked("s?", "M1")], "number M1, the rig file says M2"),
        ([*SYNC, (b"n?\r\n", b"")], "did not answer within 1 s"),
        ([*NAMED, *told("o 0 0"), *asked("o? 0", "1"), *SYNC, *off(1), *off(2), *off(3)],
         "output 1 .* was switched off but reads on"),
        ([*IDENTIFIED, *told("m 1"), *asked("m?", "2")], "under external control"),
        ([*IDENTIFIED, *MODES, *asked("wl? 0", "625")],
         "the head on output 1 .* is one of 625 nm, the LED '455 nm' .* peak at 455 nm"),
        ([*IDENTIFIED, *MODES, *asked("wl? 0", "blue")], "expected a number, got 'bl"),
    ],
    ids=["another device", "another unit", "silent", "stuck", "mode", "another head", "no number"],
)  # fmt: skip
def test_what_is_not_as_expected_keeps_it_from_being_used(script: Script, said: str) -> None:
    serial = {"serial_numbers": {"COM7": "M2"}} if "M2" in said else {}
    with pytest.raises(DeviceError, match=said) as caught:
        bank(script, **serial)
    assert "\n" not in str(caught.value)


def test_a_command_that_is_refused_is_told() -> None:
    refused: Script = [(b"bp 0 60\r\n", b""), *asked("e?", "ERROR 20:Parameter out of range")]
    driver, _ = bank([*OPENED, *refused])
    with pytest.raises(UnclearAnswerError, match="sent 'bp 0 60' and reports 'ERROR 20:Param"):
        driver.light("455 nm")


def test_a_brightness_that_does_not_hold_is_told() -> None:
    driver, _ = bank([*OPENED, *told("bp 0 60"), *asked("bp? 0", "100")])
    with pytest.raises(UnclearAnswerError, match="set to 60 % and reads 100 %"):
        driver.light("455 nm")


def test_a_head_a_little_off_is_a_warning() -> None:
    heads = [*asked("wl? 0", "462"), *asked("wl? 3", "530")]
    driver, _ = bank([*IDENTIFIED, *MODES, *heads, *heads])
    (finding,) = driver.findings()
    assert finding.severity == "warn"
    assert "says 462 nm, the rig file's peak is 455 nm" in finding.what


def nine() -> Any:
    """Nine LEDs on three units."""
    channels = {}
    for number in range(9):
        channels[f"{400 + 40 * number} nm"] = {
            "output": number % 4 + 1, "centre": 400 + 40 * number, "fwhm": 20, "brightness": "50 %",
        } | ({"address": f"COM{8 + number // 4}"} if number >= 4 else {})  # fmt: skip
    return ThorlabsLeds.Settings.model_validate({"channels": channels})


def three_units(heads: Heads) -> Iterator[tuple[str, Dc4100Board]]:
    class Shifted:
        def __init__(self, first: int) -> None:
            self.first = first

        def switch(self, output: int, on: bool) -> None:
            heads.switch(self.first + output, on)

        def dim(self, output: int, fraction: float) -> None:
            heads.dim(self.first + output, fraction)

    for unit, address in enumerate(("COM7", "COM9", "COM10")):
        outputs = range(4 if unit < 2 else 1)
        wavelengths = {output: 400.0 + 40 * (4 * unit + output) for output in outputs}
        yield address, Dc4100Board(Shifted(4 * unit), wavelengths, f"M{unit}")


@settings(max_examples=30)
@given(st.lists(st.integers(-1, 8), max_size=6), st.integers(1, 400), st.integers(0, 11))
def test_over_three_units_two_are_never_lit_and_any_interruption_can_be_made_safe(
    sequence: list[int], waits: int, left_on: int
) -> None:
    clock, heads = InterruptingClock(), Heads()
    units = dict(three_units(heads))
    list(units.values())[left_on // 4].receive(f"o {left_on % 4} 1\n".encode())
    driver = ThorlabsLeds("COM7", nine(), Units(clock, units))
    assert not any(heads.lit.values())
    with clock.interrupted_after(waits):
        for number in sequence:
            if number < 0:
                driver.dark()
                assert driver.channel_on() is None
            else:
                driver.light(driver.channels()[number])
                assert driver.channel_on() == driver.channels()[number]
                assert heads.lit[number]
                assert heads.fractions[number] == 0.5
    assert heads.most <= 1
    driver.make_safe()
    assert not any(heads.lit.values())


def test_a_unit_that_is_missing_leaves_no_light_on_the_others() -> None:
    clock, heads = VirtualClock(), Heads()
    units = dict(list(three_units(heads))[:2])
    next(iter(units.values())).receive(b"o 2 1\n")
    assert heads.lit[2]
    with pytest.raises(KeyError, match="COM10"):
        ThorlabsLeds("COM7", nine(), Units(clock, units))
    assert not any(heads.lit.values())


def test_an_output_that_stays_on_does_not_keep_the_others_lit() -> None:
    stays_on = [*told("o 1 0"), *asked("o? 1", "1"), *SYNC]
    driver, port = bank([*OPENED, *SYNC, *off(0), *stays_on, *off(2), *off(3)])
    with pytest.raises(UnclearAnswerError, match=r"output 2 .* reads on; switch off by hand"):
        driver.make_safe()
    assert port.script == []


def test_the_limit_of_current_is_that_of_the_output_that_is_lit() -> None:
    dimmed = {"455 nm": {"output": 1}, "530 nm": {"output": 4, "brightness": "50 %"}}
    driver, _ = bank([*OPENED, *lit(3, 50, str(0x200000 << 6))], channels=dimmed)
    with pytest.raises(DeviceError, match=r"output 4 .* has reached its current limit at 50 %"):
        driver.light("530 nm")
    # Output 1's limit says nothing about output 4.
    driver, port = bank([*OPENED, *lit(3, 50, str(0x200000))], channels=dimmed)
    driver.light("530 nm")
    assert port.script == []


def test_a_missing_head_is_told_and_the_others_go_on() -> None:
    clock, heads = VirtualClock(), Heads()
    unit = Dc4100Board(heads, {0: 455.0})
    driver = ThorlabsLeds(
        "COM7", ThorlabsLeds.Settings.model_validate({"channels": CHANNELS}),
        Units(clock, {"COM7": unit}),
    )  # fmt: skip
    with pytest.raises(DeviceError, match=r"output 4 .* no LED head is connected"):
        driver.light("530 nm")
    driver.light("455 nm")
    assert heads.lit[0]


def test_a_serial_number_of_no_unit_is_a_mistake() -> None:
    with pytest.raises(UsageError, match="no unit is at COM8"):
        bank([], serial_numbers={"COM8": "M1"})


def test_a_unit_that_is_gone_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, port = bank(OPENED)

    def gone(data: bytes) -> int:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(port, "write", gone)
    with pytest.raises(DeviceLostError, match="the DC4100 at COM7 is gone"):
        driver.light("455 nm")


@pytest.mark.parametrize(
    "channels",
    [{}, {"a": {"output": 5}}, {"a": {"output": 0}}, {"a": {"output": 1}, "b": {"output": 1}},
     {"a": {"output": 1, "brightness": "0 %"}}, {"a": {"output": 1, "brightness": "33.3 %"}},
     {"a": {"output": 1, "centre": 450}}, {"": {"output": 1}}],
)  # fmt: skip
def test_each_led_has_a_name_an_output_and_a_brightness(channels: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ThorlabsLeds.Settings.model_validate({"channels": channels})
