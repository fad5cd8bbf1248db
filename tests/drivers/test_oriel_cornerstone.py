"""An Oriel Cornerstone, against transcripts and against the simulated one."""

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Monochromator, Tune
from labrig.drivers.oriel_cornerstone import OrielCornerstone
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError, UnclearAnswerError
from labrig.sim.boards import CornerstoneBoard
from tests.drivers.serial_wire import BoardPort, Script, ScriptedPort, Wired

OPENED: Script = [
    (b"\r\n", b""),
    (b"INFO?\r\n", b"INFO?\r\nOriel Instruments,Cornerstone 260\r\n"),
]
SETTINGS = OrielCornerstone.Settings(fwhm=10.0, travel="8 s")


def scripted(script: Script) -> tuple[OrielCornerstone, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, [*OPENED, *script])
    return OrielCornerstone("COM6", SETTINGS, Wired(clock, port)), port


@pytest.mark.parametrize("echo", [True, False])
def test_the_wavelength_and_the_shutter_are_read_back(echo: bool) -> None:
    def said(query: str, answer: str) -> bytes:
        return (f"{query}\r\n" * echo + f"{answer}\r\n" * bool(answer)).encode()

    device, port = scripted(
        [
            (b"GOWAVE 450.000\r\n", said("GOWAVE 450.000", "")),
            (b"WAVE?\r\n", said("WAVE?", "431.2")),
            (b"WAVE?\r\n", said("WAVE?", "450.08")),
            (b"SHUTTER O\r\n", said("SHUTTER O", "")),
            (b"SHUTTER?\r\n", said("SHUTTER?", "O")),
        ]
    )
    assert isinstance(device, Monochromator)
    assert "Cornerstone 260" in device.identity()
    device.tune(450.0)
    assert port.script == []


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ([(b"WAVE?\r\n", b"WAVE?\r\nE01\r\n")], "expected a number, got 'E01'"),
        ([(b"WAVE?\r\n", b"")], "did not answer within 10 s"),
    ],
)
def test_an_instrument_that_answers_something_else(script: Script, message: str) -> None:
    device, _ = scripted([(b"GOWAVE 450.000\r\n", b""), *script])
    with pytest.raises(UnclearAnswerError, match=message):
        device.tune(450.0)


def test_the_simulated_one_turns_its_grating() -> None:
    clock = VirtualClock()
    tuned: list[tuple[float, bool]] = []
    board = CornerstoneBoard(lambda nm, is_open: tuned.append((nm, is_open)), clock)
    board.receive(b"GOW")  # cut off
    device = OrielCornerstone("COM6", SETTINGS, Wired(clock, BoardPort(clock, board)))
    before_s = clock.now()
    device.tune(600.0)
    assert clock.now() - before_s == pytest.approx(600 / 175, abs=0.4)
    assert board.wavelength_nm == pytest.approx(600.0, abs=0.1)
    assert tuned[-1][0] == pytest.approx(600.0, abs=0.1)
    assert tuned[-1][1]
    device.make_safe()


@given(st.binary(max_size=40))
def test_the_simulated_one_answers_any_bytes(data: bytes) -> None:
    CornerstoneBoard(lambda nm, is_open: None, VirtualClock()).receive(data + b"\n")


def test_a_wavelength_beyond_its_range() -> None:
    device, _ = scripted([])
    with pytest.raises(ProtocolError, match="expected 350 nm to 750 nm"):
        Tune(800.0).begin(device)


def test_its_band_is_as_wide_as_the_rig_file_says() -> None:
    band = SETTINGS.transmittance(500.0)
    assert band.at([480.0, 490.0, 495.0, 500.0, 505.0, 510.0]) == pytest.approx(
        [0, 0, 0.5, 1, 0.5, 0], abs=1e-12
    )
