"""The lamp fades as the paper's does, warms up, ages and adds up its light correctly."""

import numpy as np
import pytest
from scipy.integrate import quad

from labrig.sim.lamp import BURNING_K, SETTLED_S, WAVELENGTH_NM, Lamp, filament_spectrum
from labrig.sim.simulation import LampSettings

STEADY = LampSettings(warm_up_deficit=0.0, drift_per_hour=0.0)
OFF_S = 100.0


def cell(wavelength_nm: float) -> int:
    return int(np.argmin(np.abs(WAVELENGTH_NM - wavelength_nm)))


@pytest.fixture(scope="module")
def fading() -> Lamp:
    return Lamp.found(STEADY, on=True).switched(False, OFF_S)


@pytest.mark.parametrize(("wavelength_nm", "fade_s"), [(419, 0.031), (650, 0.051)])
def test_fades_to_1_e_sooner_in_the_blue(fading: Lamp, wavelength_nm: float, fade_s: float) -> None:
    after_s = np.linspace(0, 0.2, 2001)
    left = np.array([fading.irradiance(OFF_S + t)[cell(wavelength_nm)] for t in after_s])
    measured_s = np.interp(-np.exp(-1), -left / left[0], after_s)
    assert measured_s == pytest.approx(fade_s, rel=0.15)


def test_dark_after_320_ms(fading: Lamp) -> None:
    full = fading.irradiance(OFF_S)
    seen = WAVELENGTH_NM < 700
    assert (fading.irradiance(OFF_S + 0.32) / full)[cell(550)] == pytest.approx(1e-4, rel=0.3)
    assert np.all(fading.irradiance(OFF_S + 0.1)[seen] > 1e-3 * full[seen])
    assert np.all(fading.irradiance(OFF_S + 0.5)[seen] < 1e-5 * full[seen])
    assert fading.dark(OFF_S + SETTLED_S, 1e6)
    assert not fading.irradiance(OFF_S + SETTLED_S).any()


def test_burns_at_full_light_soon_after_switching_on() -> None:
    lamp = Lamp.found(STEADY, on=False).switched(True, 10.0)
    assert not lamp.irradiance(9.9).any()
    full = filament_spectrum(BURNING_K)
    assert lamp.irradiance(12.0) == pytest.approx(full, rel=1e-6)
    assert full[cell(560)] == pytest.approx(1.0, rel=0.01)
    assert full[cell(400)] < 0.3 * full[cell(560)] < full[cell(700)]


def test_switching_during_the_fade_does_not_jump() -> None:
    lamp = Lamp.found(STEADY, on=True).switched(False, 5.0).switched(True, 5.1)
    before, after = lamp.temperature_k(5.1 - 1e-9), lamp.temperature_k(5.1 + 1e-9)
    assert before == pytest.approx(after, abs=0.01)
    assert 1500 < after < 2800


def test_warms_up_and_drifts() -> None:
    lamp = Lamp.found(LampSettings(drift_per_hour=0.0), on=False).switched(True, 0.0)
    full = filament_spectrum(BURNING_K)
    assert (lamp.irradiance(5.0) / full)[0] == pytest.approx(0.971, abs=0.001)
    assert (lamp.irradiance(900.0) / full)[0] == pytest.approx(1.0, abs=1e-4)
    # Switched off for a moment, the housing stays warm.
    again = lamp.switched(False, 1000.0).switched(True, 1010.0)
    assert (again.irradiance(1014.0) / full)[0] > 0.997
    ageing = Lamp.found(LampSettings(drift_per_hour=0.01), on=True)
    assert (ageing.irradiance(7200.0) / full)[0] == pytest.approx(0.99**2, rel=1e-9)


def test_exposure_is_the_integral_of_the_light() -> None:
    lamp = Lamp.found(LampSettings(), on=False).switched(True, 1.0).switched(False, 4.2)
    for wavelength_nm in (420, 680):
        at = cell(wavelength_nm)

        def light(time_s: float, at: int = at) -> float:
            return float(lamp.irradiance(time_s)[at])

        spans = ((0.5, 1.0), (1.0, 1.3), (1.3, 4.0), (4.0, 4.2), (4.2, 5.0))
        expected = sum(quad(light, *span, limit=200, epsabs=1e-9)[0] for span in spans)
        assert lamp.exposure(0.5, 5.0)[at] == pytest.approx(expected, rel=1e-6)


def test_past_is_not_changed_by_later_switches() -> None:
    lamp = Lamp.found(LampSettings(), on=True).switched(False, 10.0)
    later = lamp.switched(True, 20.0).switched(False, 21.0)
    assert later.until(15.0).phases == lamp.phases
    assert np.array_equal(later.irradiance(10.05), lamp.irradiance(10.05))
    assert (lamp.last_switch_off(9.0), later.last_switch_off(20.5)) == (None, 10.0)
    assert later.switched(False, 22.0) is later
