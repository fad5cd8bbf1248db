"""The integrated rate equations against solutions that are known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.special import hyp1f1

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.material.file import read_material
from labrig.sim.lamp import BURNING_K, WAVELENGTH_NM, Lamp, filament_spectrum
from labrig.sim.phosphor import Phosphor, band_cells, phosphor
from labrig.sim.simulation import LampSettings

STEADY = LampSettings(warm_up_deficit=0.0, drift_per_hour=0.0)


class ExponentialFade:
    """Light e^(−t/τ) from time 0 on, the same at all wavelengths; τ infinite: constant light."""

    def __init__(self, fade_s: float) -> None:
        self.fade_s = fade_s

    def corners(self, start_s: float, end_s: float) -> list[float]:
        return []

    def dark(self, start_s: float, end_s: float) -> bool:
        return False

    def irradiance(self, time_s: FloatArray) -> FloatArray:
        return np.exp(-time_s / self.fade_s)[:, None] * np.ones_like(WAVELENGTH_NM)


def one_state(k_r_per_s: float, kappa_per_s: float) -> Phosphor:
    row = np.zeros_like(WAVELENGTH_NM)
    row[7] = kappa_per_s
    return Phosphor(np.array([k_r_per_s]), row[None, :], np.array([0], dtype=np.intp))


@settings(max_examples=25, deadline=None)
@given(
    k_r=st.floats(1e-4, 1),
    kappa=st.just(0.0) | st.floats(1e-12, 2),
    r0=st.floats(0, 1),
    time_s=st.floats(0.01, 300),
)
def test_constant_light(k_r: float, kappa: float, r0: float, time_s: float) -> None:
    level, exposure_s = one_state(k_r, kappa).evolve(
        np.array([r0]), 0.0, time_s, ExponentialFade(np.inf)
    )
    s, r_end = kappa + k_r, kappa / (kappa + k_r)
    assert level[0] == pytest.approx(r_end + (r0 - r_end) * np.exp(-s * time_s), rel=2e-6, abs=1e-7)
    integral = r_end * time_s - (r0 - r_end) * np.expm1(-s * time_s) / s
    assert exposure_s[0] == pytest.approx(integral, rel=2e-6, abs=1e-7)


@pytest.mark.parametrize("k_r", [0.015, 0.227, 1.3])
@pytest.mark.parametrize("kappa", [0.05, 3.0])
def test_exponential_fade_against_kummers_function(k_r: float, kappa: float) -> None:
    fade_s, time_s, r0 = 0.3, 2.0, 0.4
    level, _ = one_state(k_r, kappa).evolve(np.array([r0]), 0.0, time_s, ExponentialFade(fade_s))
    p = k_r * fade_s

    def x(t: float) -> float:
        return float(kappa * fade_s * np.exp(-t / fade_s))

    def m(at: float) -> float:
        return float(at * hyp1f1(1, 2 - p, at) / (1 - p))

    expected = np.exp(-k_r * time_s + x(time_s) - x(0)) * (r0 + m(x(0))) - m(x(time_s))
    assert level[0] == pytest.approx(expected, rel=1e-7)


def test_dark_decay_over_ten_lifetimes() -> None:
    lamp = Lamp.found(STEADY, on=False)
    level, _ = one_state(0.05, 1.0).evolve(np.array([0.7]), 0.0, 200.0, lamp)
    assert level[0] == pytest.approx(0.7 * np.exp(-10), rel=1e-5)


def test_table_1_is_neither_hardly_nor_fully_charged_by_the_default_lamp() -> None:
    names = [n for n in resources.names("config/materials") if n != "power-law"]
    materials = [read_material(name) for name in names]
    states = phosphor(materials, [None] * len(names), STEADY.irradiance)
    lamp = Lamp.found(STEADY, on=True)
    kappa = states.excitation @ filament_spectrum(BURNING_K)
    level, _ = states.evolve(np.zeros_like(kappa), 0.0, 5400.0, lamp)
    assert level == pytest.approx(kappa / (kappa + states.k_r_per_s), rel=1e-6)
    assert level.min() > 0.1
    assert level.max() < 0.8


def test_excitation_belongs_to_an_irradiance_of_the_stated_length() -> None:
    blue = read_material("blue-paint")
    assert blue.bands_nm is not None
    E = band_cells(blue.bands_nm) @ filament_spectrum(BURNING_K)
    E *= 4.0 / np.linalg.norm(E)
    kappa = phosphor([blue], [None], 4.0).excitation @ filament_spectrum(BURNING_K)
    assert kappa[0] == pytest.approx(0.017 * E[0] + 0.05 * E[1] + 0.004 * E[2])


def test_charge_can_be_given() -> None:
    names = ("stickers", "gloves", "blue-paint")
    states = phosphor([read_material(n) for n in names], [None, 0.8, 0.25], 4.0)
    level, _ = states.evolve(np.zeros(3), 0.0, 3000.0, Lamp.found(STEADY, on=True))
    assert level == pytest.approx([0.5, 0.8, 0.25], rel=1e-6)


def test_power_law_material_fades_by_a_power_law() -> None:
    material = read_material("power-law")
    states = phosphor([material], [None], 4.0)
    weight = np.array([sum(s.reradiation or ()) * s.k_r_per_s for s in material.states])
    dark = Lamp.found(STEADY, on=False)
    level, start_s = np.ones(len(weight)), 0.0
    for time_s in (1.0, 5.0, 20.0, 60.0, 180.0, 1000.0, 10_000.0):
        level, _ = states.evolve(level, start_s, time_s, dark)
        start_s = time_s
        left = weight @ level / weight.sum()
        assert left == pytest.approx((1 + time_s / 10.0) ** -1.2, rel=0.01)
