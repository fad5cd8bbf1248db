"""Real python-seabreeze against a simulated USB2000+ in the simulated room."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import usb.core

from labrig.acquire import Checkable, Connections, Spectrometer
from labrig.drivers.seabreeze_spectrometer import SeabreezeSpectrometer, _serial_number
from labrig.foundation.clock import Clock, Interrupted
from labrig.foundation.errors import (
    DeviceError,
    DeviceLostError,
    ProtocolError,
    UnclearAnswerError,
    UsageError,
)
from labrig.optics import Spectrum, lamp_calibration
from labrig.sim import OpenRoom, open_room
from labrig.sim.lamp import WAVELENGTH_NM
from labrig.sim.leds import led_spectrum
from labrig.sim.spectrometer.instrument import UNIT_IRRADIANCE, Detector

pytest.importorskip("seabreeze")

ROOM: dict[str, Any] = {
    "sample": "blue-paint",
    "sensor": {"width": 32, "height": 32},
    "leds": [{"relay": 1, "centre": 450, "fwhm": 25}, {"relay": 2, "centre": 620, "fwhm": 20}],
}
LIT_FROM = 21


class OnRoom:
    """Connections to the devices of a simulated room."""

    def __init__(self, room: OpenRoom) -> None:
        self.clock: Clock = room.clock
        self._room = room

    def usb(self, address: str, serial_of: object = None) -> Any:
        device = usb.core.find(backend=self._room.usb(address.rpartition("/")[2]))
        if device is None:
            raise DeviceError(f"no device at {address}")
        return device

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> Any:
        raise AssertionError("no serial line here")

    def tcp(self, address: str, default_port: int) -> Any:
        raise AssertionError("no network here")


@contextmanager
def bench(
    calibration: Path | None = None, **changed: Any
) -> Iterator[tuple[SeabreezeSpectrometer, OpenRoom]]:
    with open_room({**ROOM, **changed}, "rig.yaml") as room:
        connections: Connections = OnRoom(room)
        keys = {} if calibration is None else {"calibration": str(calibration)}
        settings = SeabreezeSpectrometer.Settings.model_validate(keys)
        driver = SeabreezeSpectrometer("sim://room/spectrometer", settings, connections)
        yield driver, room
        driver.disconnect()


def detector(room: OpenRoom) -> Detector:
    """The same detector as that of the room's spectrometer."""
    return Detector(np.random.default_rng([room.seed, 10]))


def test_it_says_what_it_is() -> None:
    with bench() as (driver, room):
        assert isinstance(driver, Spectrometer)
        assert isinstance(driver, Checkable)
        assert driver.identity() == (
            "Ocean Optics USB2000PLUS, serial USB2P00001, 2048 pixels, 270.0 nm to 991.2 nm"
        )
        assert driver.integration_limits_s() == (0.001, 10.0)
        assert [finding.severity for finding in driver.findings()] == ["fine"]
        reading = driver.read(0.01, 1)
        assert reading.wavelength_nm == pytest.approx(detector(room).wavelength_nm)
        assert reading.dark_pixels == tuple(range(6, 21))
        assert reading.nonlinearity == (0.9, 4e-6, -4e-11)
        assert _serial_number(usb.core.find(backend=room.spectrometer)) == "USB2P00001"


@pytest.mark.parametrize("relay", [1, pytest.param(2, marks=pytest.mark.campaign)])
def test_an_led_is_measured_within_its_sigma(relay: int) -> None:
    scores, of_peak = [], []
    for seed in range(1, 5):
        with bench(seed=seed) as (driver, room):
            dark = driver.read(0.1, 12)
            room.room.switch_led(relay, True)
            spectrum = driver.read(0.1, 12).corrected(dark)
            light = led_spectrum(room.room.leds.bank[relay - 1])
            true = detector(room).linear_counts(0.1 * light)
        assert spectrum.sigma is not None
        assert not spectrum.saturated.any()
        score = (spectrum.counts - true) / spectrum.sigma
        scores.append(score[LIT_FROM:])
        of_peak.append(score[true > 2000])
    bright = np.concatenate(of_peak)
    assert len(bright) > 400
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.08)
    assert np.sqrt(np.mean(bright**2)) == pytest.approx(1.0, abs=0.12)
    # Counts as read are not linear: at the peak they are some per cent off, which is many σ.
    assert abs(bright.mean()) < 0.3


def test_light_that_was_there_before_is_not_in_a_reading() -> None:
    with bench() as (driver, room):
        dark = driver.read(0.5, 4)
        room.room.switch_led(1, True)
        room.clock.spend(3.3)
        driver.read(0.5, 1)
        # In the middle of an integration, whose spectrum is the next that is read.
        room.clock.spend(0.4)
        room.room.switch_led(1, False)
        after = driver.read(0.5, 4).corrected(dark)
    assert after.sigma is not None
    assert abs(after.counts[LIT_FROM:] / after.sigma[LIT_FROM:]).max() < 6


def test_twice_the_time_gives_twice_the_counts() -> None:
    with bench() as (driver, room):
        near = abs(detector(room).wavelength_nm - 450) < 40
        darks = {time_s: driver.read(time_s, 20) for time_s in (0.05, 0.1, 0.2)}
        room.room.switch_led(1, True)
        totals = {
            time_s: driver.read(time_s, 20).corrected(dark).counts[near].sum() / time_s
            for time_s, dark in darks.items()
        }
    assert totals[0.1] == pytest.approx(totals[0.05], rel=3e-3)
    assert totals[0.2] == pytest.approx(totals[0.05], rel=3e-3)


def test_lamp_and_leaking_light_are_seen_at_the_white_reference() -> None:
    with bench(ambient=0.01) as (driver, room):
        leaked = driver.read(0.1, 4).corrected().counts
        room.room.switch_lamp(True)
        room.clock.spend(5.0)
        lit = driver.read(0.1, 4).corrected().counts
    wavelength_nm = detector(room).wavelength_nm
    visible = (wavelength_nm > 420) & (wavelength_nm < 740)
    assert leaked[visible].mean() > 30
    assert lit[visible].mean() > 30 * leaked[visible].mean()


def test_too_much_light_is_marked() -> None:
    with bench() as (driver, room):
        room.room.switch_led(1, True)
        spectrum = driver.read(1.0, 2).corrected()
    marked_nm = spectrum.wavelength_nm[spectrum.saturated]
    assert len(marked_nm) > 10
    assert (abs(marked_nm - 450) < 30).all()


@pytest.mark.parametrize("integration_s", [0.0005, 10.5, 700.0])
def test_times_that_it_does_not_offer_are_refused(integration_s: float) -> None:
    with bench() as (driver, _), pytest.raises(ProtocolError, match="1 ms to 10 s are offered"):
        driver.read(integration_s, 1)


def test_a_standard_lamp_gives_the_absolute_scale(tmp_path: Path) -> None:
    path = tmp_path / "scale.csv"
    with bench() as (driver, room):
        dark = driver.read(0.1, 20)
        room.room.switch_lamp(True)
        room.clock.spend(900.0)
        standard = driver.read(0.1, 20).corrected(dark)
        irradiance = UNIT_IRRADIANCE * room.room.white_exposure(
            room.clock.now() - 0.1, room.clock.now()
        ) / 0.1  # fmt: skip
        lamp = Spectrum("standard", WAVELENGTH_NM, irradiance)
        scale = lamp_calibration(standard, lamp)
    assert scale.sigma is not None
    rows = zip(scale.wavelength_nm, scale.value, scale.sigma, strict=True)
    lines = [f"{nm!r},{value!r},{sigma!r}" for nm, value, sigma in np.array(list(rows)).tolist()]
    path.write_text("\n".join(["wavelength_nm,value,sigma", *lines]) + "\n")
    with bench(calibration=path) as (driver, room):
        dark = driver.read(0.1, 20)
        room.room.switch_led(1, True)
        spectrum = driver.read(0.1, 20).corrected(dark)
        light = led_spectrum(room.room.leds.bank[0])
    assert spectrum.irradiance is not None
    assert spectrum.irradiance_sigma is not None
    expected = UNIT_IRRADIANCE * np.interp(spectrum.wavelength_nm, WAVELENGTH_NM, light)
    lit = expected > 0.1 * expected.max()
    assert spectrum.irradiance[lit] == pytest.approx(expected[lit], rel=0.05)
    scores = (spectrum.irradiance - expected)[lit] / spectrum.irradiance_sigma[lit]
    assert np.sqrt(np.mean(scores**2)) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(
    ("fault", "kind", "said"),
    [
        ("spectrometer_unplugged", DeviceLostError, "is gone .* plug it in again"),
        ("spectrometer_silent", UnclearAnswerError, "did not answer in time"),
        ("spectrometer_truncated", UnclearAnswerError, "too short or damaged"),
    ],
)
def test_faults_in_the_middle_are_told_and_it_comes_back(
    fault: str, kind: type[DeviceError], said: str
) -> None:
    faults = [{fault: {"at": "2.55 s", "for": "8 s"}}]
    with bench(faults=faults) as (driver, room):
        driver.read(0.1, 2)
        with pytest.raises(kind, match=said) as caught:
            driver.read(0.1, 50)
        assert "\n" not in str(caught.value)
        assert 2.5 < room.clock.now() < 6
        with pytest.raises(DeviceError):
            driver.read(0.1, 1)
        driver.make_safe()
        room.clock.sleep_until(12.0)
        driver.make_safe()
        assert len(driver.read(0.1, 5).raw_counts) == 5


def test_a_reading_can_be_interrupted_between_repetitions() -> None:
    with bench() as (driver, room):
        room.clock.interrupt(2)
        with pytest.raises(Interrupted):
            driver.read(0.1, 50)
        assert room.clock.now() < 2
        assert len(driver.read(0.1, 2).raw_counts) == 2


def test_what_is_missing_is_told() -> None:
    faults = ["spectrometer_unplugged"]
    with pytest.raises(DeviceError, match="no device at"), bench(faults=faults):
        pass


def test_another_device_is_told() -> None:
    with open_room(ROOM, "rig.yaml") as room:
        settings = SeabreezeSpectrometer.Settings()
        with pytest.raises(DeviceError, match=r"\(04a9:3199\) is no spectrometer that"):
            SeabreezeSpectrometer("sim://room/camera", settings, OnRoom(room))


def test_without_the_extra_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "seabreeze.pyseabreeze", None)
    with pytest.raises(UsageError, match=r"pip install 'labrig\[seabreeze\]'"), bench():
        pass


def test_a_scale_that_is_missing_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"missing\.csv"), bench(tmp_path / "missing.csv"):
        pass
