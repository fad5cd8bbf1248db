"""LEDs in the simulated room: narrow bands that reach the sample while their relays are closed."""

from itertools import pairwise

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import validate
from labrig.sim.bench_settings import LedSettings
from labrig.sim.lamp import BURNING_LIGHT, WAVELENGTH_NM, Lamp, Mercury
from labrig.sim.lamps import FilteredLamps
from labrig.sim.leds import Leds, led_spectrum
from labrig.sim.simulation import LampSettings, Simulation
from tests.sim.darkroom import Darkroom

BLUE, GREEN = LedSettings(relay=1, centre=450), LedSettings(relay=2, centre=525, fwhm=40, level=0.2)
BANK = Leds((BLUE, GREEN))
KEYS = [{"relay": 1, "centre": 450}, {"relay": 2, "centre": 640, "fwhm": 20}]


@pytest.mark.parametrize("led", [BLUE, GREEN], ids=["blue", "green"])
def test_a_band_has_its_middle_its_width_and_its_light(led: LedSettings) -> None:
    spectrum = led_spectrum(led)
    assert np.average(WAVELENGTH_NM, weights=spectrum) == pytest.approx(led.centre, abs=0.1)
    half = WAVELENGTH_NM[spectrum > spectrum.max() / 2]
    assert half[-1] - half[0] == pytest.approx(led.fwhm, abs=2.6)
    assert spectrum.sum() == pytest.approx(led.level * BURNING_LIGHT)


def test_light_is_there_from_switch_to_switch() -> None:
    bank = BANK.switched(1, True, 10.0).switched(1, False, 20.0).switched(2, True, 20.0)
    bank = bank.switched(2, False, 50.0).switched(7, True, 60.0)
    assert bank.states[-1][0] == 50.0, "nothing hangs on relay 7"
    at = [int(led_spectrum(led).argmax()) for led in (BLUE, GREEN)]
    times_s = np.array([9.0, 10.0, 19.0, 20.0, 49.0, 50.0])
    blue, green = (bank.irradiance(times_s)[:, place] > 0.1 for place in at)
    assert blue.tolist() == [False, True, True, False, False, False]
    assert green.tolist() == [False, False, False, True, True, False]
    for left, right in ((0.0, 15.0), (12.0, 25.0), (30.0, 40.0), (40.0, 70.0), (60.0, 70.0)):
        edges = [left, *bank.corners(left, right), right]
        expected = sum(
            (end - begin) * bank.irradiance((begin + end) / 2) for begin, end in pairwise(edges)
        )
        assert bank.exposure(left, right) == pytest.approx(expected)
        assert bank.dark(left, right) == (not bank.exposure(left, right).any())
    assert (bank.last_switch_off(15.0), bank.last_switch_off(45.0)) == (None, 20.0)
    assert bank.until(30.0).lit == {2}


def test_light_follows_the_brightness_from_its_change_on() -> None:
    bank = BANK.dimmed(1, 0.5, 5.0).switched(1, True, 10.0).dimmed(1, 0.25, 15.0)
    bank = bank.switched(1, False, 20.0).switched(2, True, 20.0)
    light = bank.irradiance(np.array([9.0, 10.0, 14.0, 15.0, 19.0, 20.0]))
    of_blue = light[:5] @ led_spectrum(BLUE) / (led_spectrum(BLUE) ** 2).sum()
    assert of_blue == pytest.approx([0.0, 0.5, 0.5, 0.25, 0.25])
    assert light[5] == pytest.approx(led_spectrum(GREEN))
    assert bank.exposure(10.0, 20.0) == pytest.approx(3.75 * led_spectrum(BLUE))


def test_a_white_reference_has_all_light_but_that_behind_the_shield() -> None:
    bench = Darkroom(leds=KEYS)
    bench.room.switch_led(1, True)
    bench.clock.spend(2.0)
    lit = bench.room.white_exposure(0.5, 1.5)
    assert lit == pytest.approx(bench.room.leds.exposure(0.5, 1.5))
    bench = Darkroom(leds=KEYS, ambient=0.01)
    bench.clock.spend(2.0)
    assert bench.room.white_exposure(0.0, 1.0).sum() > 0


def test_no_filter_is_before_them() -> None:
    half = 0.5 * np.ones_like(WAVELENGTH_NM)
    lamp = Lamp.found(LampSettings(), on=True)
    bank = BANK.switched(1, True, 5.0)
    lights = FilteredLamps(lamp, Mercury(), ((0.0, half),), bank)
    expected = half * lamp.exposure(0.0, 10.0) + bank.exposure(0.0, 10.0)
    assert lights.exposure(0.0, 10.0) == pytest.approx(expected)
    assert lights.irradiance(7.0) == pytest.approx(half * lamp.irradiance(7.0) + led_spectrum(BLUE))
    assert lights.corners(1.0, 10.0) == [3.0, 5.0]


def test_the_camera_sees_their_colour_and_the_sample_glows_after() -> None:
    bench = Darkroom(leds=KEYS)
    bench.clock.spend(1.0)
    assert bench.shoot(1.0).mean() == pytest.approx(0.0, abs=2)
    seen = {}
    for relay in (1, 2):
        bench.do("grey card")
        bench.room.switch_led(relay, True)
        bench.clock.spend(1.0)
        frame = bench.shoot(1 / 8, 100)
        seen[relay] = frame[0::2, 0::2].mean(), frame[1::2, 1::2].mean()
        bench.room.switch_led(relay, False)
    (red_1, blue_1), (red_2, blue_2) = seen[1], seen[2]
    assert blue_1 > 5 * red_1
    assert red_2 > 5 * blue_2
    bench.do("sample")
    bench.room.switch_led(1, True)
    bench.clock.spend(600.0)
    bench.room.switch_led(1, False)
    bench.clock.spend(1.0)
    glow = bench.shoot(1.0, 1600).mean()
    assert glow > 20
    off_s = bench.room.truth().lamp_off_s
    assert off_s == pytest.approx(bench.clock.now() - 2.0, abs=0.1)


def test_an_open_door_keeps_them_from_the_sample() -> None:
    bench = Darkroom(leds=KEYS, door={})
    bench.room.switch_led(1, True)
    bench.swing(2000e-6)
    before = bench.room.truth()
    bench.clock.spend(60.0)
    bench.room.switch_led(1, False)
    after = bench.room.truth()
    assert before.lamp_off_s is None
    concentrations = [state.concentration or 0.0 for state in after.patches[0].states]
    assert max(concentrations) < 1e-2


@pytest.mark.parametrize(
    "leds",
    [[KEYS[0], KEYS[0]], [{"relay": 0, "centre": 450}], [{"relay": 1}],
     [{"relay": 1, "centre": 450, "fwhm": 1}], [{"relay": 8, "centre": 450}]],
    ids=["two on a relay", "the lamp's relay", "no centre", "too narrow", "no such relay"],
)  # fmt: skip
def test_leds_that_cannot_be(leds: list[dict[str, float]]) -> None:
    with pytest.raises(UsageError, match="leds"):
        validate({"sample": "blue-paint", "leds": leds}, Simulation, "rig.yaml")


def test_a_dark_led_is_dark_and_a_stuck_one_stays_lit_until_the_fault_is_over() -> None:
    faults = [
        {"led_dark": {"relay": 2, "for": "20 s"}},
        {"led_stuck": {"relay": 1, "at": "5 s", "for": "20 s"}},
    ]
    bench = Darkroom(leds=KEYS, faults=faults, initial={"leds": [1]})
    assert bench.room.leds.lit == {1}
    lit = []
    for wait_s, relay, on in ((10.0, 1, False), (5.0, 2, True), (6.0, 2, True), (9.0, 2, False)):
        bench.clock.spend(wait_s)
        bench.room.switch_led(relay, on)
        lit.append(set(bench.room.leds.lit))
    assert lit == [{1}, {1}, {1, 2}, set()]


def test_a_fault_of_an_led_needs_the_led() -> None:
    with pytest.raises(ValueError, match="expected relays of 'leds', got 3, which has no LED"):
        Darkroom(leds=KEYS, faults=[{"led_dark": {"relay": 3}}])
