"""Traps of real phosphors, against other integrators, limits with known solutions, and balances."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import least_squares

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import validate
from labrig.material import Material, read_material, write_material
from labrig.material.file import IrradianceNorm, State
from labrig.sim.bench_settings import TemperatureSettings
from labrig.sim.kinetics import BOLTZMANN_EV_K, RATES_K, KineticsSettings
from labrig.sim.lamp import WAVELENGTH_NM
from labrig.sim.phosphor import Phosphor, band_cells, phosphor
from labrig.sim.simulation import Simulation
from labrig.sim.temperature import rate_factor
from tests.sim.darkroom import SMALL, Darkroom

THERMAL_EV = BOLTZMANN_EV_K * RATES_K


@dataclass(frozen=True)
class Light:
    """Light of one wavelength that gives κ = `kappa_per_s` e^(−t/fade)."""

    kappa_per_s: float
    fade_s: float = np.inf
    cell: int = 60

    def corners(self, start_s: float, end_s: float) -> list[float]:
        return []

    def dark(self, start_s: float, end_s: float) -> bool:
        return self.kappa_per_s == 0

    def irradiance(self, time_s: FloatArray) -> FloatArray:
        light = np.zeros((len(time_s), len(WAVELENGTH_NM)))
        light[:, self.cell] = self.kappa_per_s * np.exp(-time_s / self.fade_s)
        return light


DARK = Light(0.0)


def sample(k_r: float, kinetics: Mapping[str, object], faster: float = 1.0) -> Phosphor:
    """Traps of one state of which κ is that of the `Light`."""
    material = Material(
        name="one",
        kind="phosphor",
        bands_nm=(400.0, 500.0, 600.0),
        irradiance_norm=IrradianceNorm(kind="vector_length", value=1.0),
        states=(State(k_r_per_s=k_r, k_e_per_s=(2.0, 1.0), reradiation=(0.0, 1.0)),),
    )
    traps = phosphor([material], [None], 1.0, [KineticsSettings.model_validate(kinetics)])
    at_surface = phosphor([material], [None], 1.0).excitation.max()
    return replace(traps, excitation=traps.excitation / at_surface, rate_factor=lambda _: faster)


def followed(
    traps: Phosphor, n: float | FloatArray, time_s: float, light: Light = DARK
) -> tuple[FloatArray, float]:
    """Filled fractions after a time, and carriers that recombined meanwhile."""
    level = np.broadcast_to(n, traps.k_r_per_s.shape).astype(float)
    level, exposure_s = traps.evolve(level, 0.0, time_s, light)
    return level, recombined(traps, exposure_s)


def recombined(traps: Phosphor, exposure_s: FloatArray) -> float:
    assert traps.traps is not None
    return float(traps.traps.share @ (traps.k_r_per_s * exposure_s))


#: (dn/dt, emission) as textbooks write them, of n, f and p.
TEXTBOOK: dict[str, tuple[dict[str, object], Callable[..., tuple[float, float]]]] = {
    "otor": (
        {"model": "otor", "retrapping": 0.1},
        lambda n, f, p: (
            (f + p * n) * 0.1 * (1 - n) / (0.1 * (1 - n) + n) - p * n,
            (f + p * n) * n / (0.1 * (1 - n) + n),
        ),
    ),
    "general order": (
        {"model": "general_order", "order": 1.6, "prompt": 0.5},
        lambda n, f, p: ((1 - n) * f - p * n**1.6, p * n**1.6 + 0.5 * f * n),
    ),
    "convex": (
        {"charging_offset": 0.3},
        lambda n, f, p: ((1 - n) * f * (0.3 + n) / 0.8 - p * n, p * n),
    ),
    "glow excites glow": (
        {"self_excitation": 0.3},
        lambda n, f, p: ((1 - n) * (f + 0.3 * p * n) - p * n, p * n),
    ),
    "glow excites glow, otor": (
        {"model": "otor", "retrapping": 0.1, "self_excitation": 0.2},
        lambda n, f, p: _glow_of_one_trap(n, f, p, 0.1, 0.2),
    ),
}


def _glow_of_one_trap(n: float, f: float, p: float, r: float, s: float) -> tuple[float, float]:
    """Solve e = (f + s e + p n) g, g the probability to recombine."""
    recombines = n / (r * (1 - n) + n)
    emission = (f + p * n) * recombines / (1 - s * recombines)
    return (f + s * emission + p * n) * (1 - recombines) - p * n, emission


@settings(max_examples=12, deadline=None)
@given(
    name=st.sampled_from(sorted(TEXTBOOK)),
    k_r=st.floats(1e-3, 1),
    kappa=st.just(0.0) | st.floats(1e-6, 2),
    fade_s=st.sampled_from([5.0, np.inf]),
    n0=st.floats(0, 1, allow_subnormal=False),
    time_s=st.floats(0.1, 100),
)
def test_laws_are_integrated_as_another_integrator_does(
    name: str, k_r: float, kappa: float, fade_s: float, n0: float, time_s: float
) -> None:
    keys, law = TEXTBOOK[name]
    light = Light(kappa, fade_s)
    level, emitted = followed(sample(k_r, keys, faster=1.5), n0, time_s, light)
    other = solve_ivp(
        lambda t, y: law(min(max(y[0], 0.0), 1.0), kappa * np.exp(-t / fade_s), 1.5 * k_r),
        (0.0, time_s),
        [n0, 0.0],
        method="LSODA",
        rtol=1e-10,
        atol=1e-12,
    ).y[:, -1]
    assert [level[0], emitted] == pytest.approx(other, rel=2e-6, abs=1e-8)


@pytest.mark.parametrize(
    "keys",
    [{"model": "otor", "retrapping": 0.3}, {"model": "general_order", "order": 1.8, "prompt": 1}],
    ids=["otor", "general order"],
)
def test_every_carrier_is_trapped_or_recombines(keys: dict[str, object]) -> None:
    level, emitted = followed(sample(0.05, keys), 0.2, 40.0, Light(0.1))
    assert emitted == pytest.approx(0.1 * 40.0 - (level[0] - 0.2), rel=1e-6)


@pytest.mark.parametrize("time_s", [0.5, 20.0, 400.0])
def test_retrapping_leads_from_first_order_to_second(time_s: float) -> None:
    n, k_r = 0.8, 0.05
    little, _ = followed(sample(k_r, {"model": "otor", "retrapping": 1e-6}), n, min(time_s, 60.0))
    assert little[0] == pytest.approx(n * np.exp(-k_r * min(time_s, 60.0)), rel=1e-3)
    equal, _ = followed(sample(k_r, {"model": "otor", "retrapping": 1}), n, time_s)
    assert equal[0] == pytest.approx(n / (1 + n * k_r * time_s), rel=1e-7)
    two, emitted = followed(sample(k_r, {"model": "general_order", "order": 2}), n, time_s)
    assert two[0] == pytest.approx(equal[0], rel=1e-7)
    assert emitted == pytest.approx(n - two[0], rel=1e-6)
    first, _ = followed(sample(k_r, {"model": "general_order", "order": 1}), n, time_s)
    assert first[0] == pytest.approx(n * np.exp(-k_r * time_s), rel=1e-5, abs=1e-10)


def test_weak_light_charges_a_trap_that_retraps_ever_faster() -> None:
    """At R = 1 and f < 2p charging is convex at first."""
    traps = sample(0.1, {"model": "otor", "retrapping": 1})
    emission = np.diff([followed(traps, 0.0, t, Light(0.05))[1] for t in (0.0, 1.0, 2.0, 3.0)])
    assert np.all(np.diff(emission, n=2) > 0)


@pytest.mark.parametrize("depth_ev", [0.4, 0.65, 1.1])
def test_traps_are_emptied_faster_by_arrhenius_law(depth_ev: float) -> None:
    faster = rate_factor(TemperatureSettings(start=31.0))(0.0)
    warm, cool = (
        followed(sample(0.01, {"depth_ev": depth_ev}, factor), 1.0, 1.0)[0]
        for factor in (faster, 1.0)
    )
    ratio = np.log(warm[0]) / np.log(cool[0])
    assert ratio == pytest.approx(np.exp(depth_ev / BOLTZMANN_EV_K * (1 / RATES_K - 1 / 304.15)))


def test_a_frequency_factor_says_how_fast_a_depth_is_emptied() -> None:
    rate = 1e10 * np.exp(-0.7 / THERMAL_EV)
    keys = {"model": "trap_depths", "width_ev": 0.001, "depth_ev": 0.7, "frequency_per_s": 1e10}
    level, _ = followed(sample(123.0, keys), 1.0, 0.5 / rate)
    assert level.mean() == pytest.approx(np.exp(-0.5), rel=0.03)


@pytest.mark.parametrize("time_s", [1.0, 30.0, 3000.0])
def test_gaussian_depths_decay_as_the_integral_over_them(time_s: float) -> None:
    keys = {"model": "trap_depths", "shape": "gaussian", "width_ev": 0.06}
    _, emitted = followed(sample(0.05, keys), 1.0, time_s)

    def emptied(widths: float) -> float:
        rate = 0.05 * np.exp(-widths * 0.06 / THERMAL_EV)
        weight = np.exp(-(widths**2) / 2) / np.sqrt(2 * np.pi)
        return float(-weight * np.expm1(-rate * time_s))

    assert emitted == pytest.approx(quad(emptied, -8, 8, epsabs=1e-9)[0], rel=1e-4)


def test_exponential_depths_decay_by_a_power_law() -> None:
    width_ev = 0.06
    traps = sample(10.0, {"model": "trap_depths", "shape": "exponential", "width_ev": width_ev})
    level, times_s = np.ones_like(traps.k_r_per_s), np.geomspace(10.0, 3000.0, 7)
    glow, at_s = [], 0.0
    for time_s in times_s:
        level, _ = traps.evolve(level, at_s, time_s, DARK)
        level, exposure_s = traps.evolve(level, time_s, at_s := 1.001 * time_s, DARK)
        glow.append(recombined(traps, exposure_s) / (0.001 * time_s))
    slopes = np.diff(np.log(glow)) / np.diff(np.log(times_s))
    assert slopes == pytest.approx(-1 - THERMAL_EV / width_ev, abs=0.03)


@pytest.mark.parametrize(
    ("density", "expected"), [(0.5, 0.96), (1.0, 0.83), (2.0, 0.53), (4.0, 0.27)]
)
def test_a_thick_layer_looks_as_if_its_re_radiation_were_less(
    density: float, expected: float
) -> None:
    """One state fits charges of a thick layer within 1 %, with another Λ."""
    k_r, kappa = 0.02, 0.05
    traps = sample(k_r, {"optical_density": density})
    times_s = np.geomspace(5.0, 1200.0, 9)
    assert traps.traps is not None
    charge = [traps.traps.share @ followed(traps, 0.0, t, Light(kappa))[0] for t in times_s]

    def misfit(x: FloatArray) -> FloatArray:
        scale, rate = np.exp(x)
        end = rate / (rate + k_r)
        return np.asarray(np.log(-scale * end * np.expm1(-(rate + k_r) * times_s) / charge))

    fitted = least_squares(misfit, np.log([1.0, kappa / 2]))
    assert np.exp(fitted.x[0]) == pytest.approx(expected, abs=0.02)
    assert np.sqrt(np.mean(fitted.fun**2)) < 0.015


@pytest.mark.parametrize("density", [1e-9, 1.0, 6.0])
def test_depths_of_a_layer_add_up_to_the_integral(density: float) -> None:
    traps = sample(0.02, {"optical_density": density})
    level, emitted = followed(traps, 0.0, 30.0, Light(0.3))
    assert traps.traps is not None

    def at_depth(z: float) -> float:
        kappa = 0.3 * 10 ** (-density * z)
        return float(kappa / (kappa + 0.02) * -np.expm1(-30.0 * (kappa + 0.02)))

    assert traps.traps.share @ level == pytest.approx(quad(at_depth, 0, 1)[0], rel=1e-4)
    # Where it absorbs less, it is thinner.
    other, _ = followed(traps, 0.0, 30.0, Light(0.6, cell=100))
    assert traps.traps.share @ other >= (1 - 1e-6) * (traps.traps.share @ level)
    assert emitted > 0


@pytest.mark.parametrize(
    "keys",
    [
        {"model": "otor", "retrapping": 0.2},
        {"model": "general_order", "order": 2},
        {"charging_offset": 0.3},
        {"self_excitation": 0.2},
    ],
    ids=["otor", "general order", "convex", "glow excites glow"],
)
def test_a_room_has_samples_of_such_kinetics_and_knows_the_truth(keys: dict[str, object]) -> None:
    patch = {**SMALL["sample"][0], "kinetics": keys, "initial_charge": 0.4}
    lamp = {"warm_up_deficit": "0 %", "drift_per_hour": "0 %"}
    bench = Darkroom(sample=[patch], lamp=lamp)
    bench.charge(5400.0)
    (true,) = bench.room.truth(iso=400).patches
    (state,) = true.states
    assert true.kinetics is not None
    assert state.concentration == pytest.approx(0.4, abs=1e-3)
    assert state.amplitude_dn_per_s is not None
    blue = bench.shoot(0.5)[21:43:2, 41:55:2].mean()
    traps = sample(state.k_r_per_s, keys)
    level, _ = followed(traps, 0.4, 3.0)
    _, at_first = followed(traps, 0.4, 1e-3)
    _, later = followed(traps, float(level[0]), 0.5)
    assert blue == pytest.approx(state.amplitude_dn_per_s[2] * later / at_first * 1e-3, rel=0.02)


def test_the_truth_of_a_thick_sample_is_that_of_its_file() -> None:
    patch = {**SMALL["sample"][0], "material": "double-wide"}
    bench = Darkroom(sample=[{**patch, "kinetics": {"optical_density": 2}}])
    bench.charge(300.0)
    thick = bench.room.truth().patches[0].states
    thin_bench = Darkroom(sample=[patch])
    thin_bench.charge(300.0)
    for state, thin in zip(thick, thin_bench.room.truth().patches[0].states, strict=True):
        assert (state.k_r_per_s, state.k_e_per_s) == (thin.k_r_per_s, thin.k_e_per_s)
        assert state.emission == pytest.approx(thin.emission)
        assert state.concentration is not None
        assert thin.concentration is not None
        assert state.amplitude_dn_per_s is not None
        assert thin.amplitude_dn_per_s is not None
        assert 0.1 * thin.concentration < state.concentration < thin.concentration
        ratio = state.concentration / thin.concentration
        amplitude = ratio * np.array(thin.amplitude_dn_per_s)
        assert state.amplitude_dn_per_s == pytest.approx(amplitude, rel=0.02)


@pytest.mark.parametrize(
    ("kinetics", "said"),
    [
        ({"model": "otor"}, "expected 'retrapping' with 'model: otor'"),
        ({"retrapping": 0.1}, "'retrapping' with 'model: otor or trap_depths' only"),
        ({"model": "otor", "retrapping": 0.1, "order": 2}, "'order' with 'model: general_order'"),
        ({"model": "trap_depths", "prompt": "5 %"}, "'prompt'"),
        ({"model": "stretched"}, "model"),
    ],
)
def test_keys_that_do_not_fit_are_named(kinetics: dict[str, object], said: str) -> None:
    content = {"sample": [{"material": "blue-paint", "kinetics": kinetics}]}
    with pytest.raises(UsageError, match=said):
        validate(content, Simulation, "rig.yaml")


def test_a_fluorescent_sample_has_no_traps() -> None:
    patch = {"material": "yellow-textile", "kinetics": {"optical_density": 1}}
    with pytest.raises(UsageError, match="expected 'kinetics' with a phosphor"):
        Darkroom(sample=[patch])


def test_excitation_varies_within_bands_and_reaches_beyond_them() -> None:
    material = read_material("blue-paint")
    assert material.bands_nm is not None
    steps, smooth, wide = (
        phosphor([material], [None], 1.0, [settings]).excitation[0]
        for settings in (
            None,
            KineticsSettings(excitation="smooth"),
            KineticsSettings(excitation_beyond=0.5),
        )
    )
    cells = band_cells(material.bands_nm)
    assert cells @ smooth == pytest.approx(cells @ steps, rel=1e-9, abs=1e-12)
    assert np.abs(smooth - steps).max() > 0.2 * steps.max()
    inside = (WAVELENGTH_NM > 400) & (WAVELENGTH_NM < 700)
    assert wide[inside] == pytest.approx(steps[inside])
    assert wide[WAVELENGTH_NM < 400] == pytest.approx(0.5 * steps[inside][0])
    assert not steps[~inside].any()


def test_a_usual_sample_beside_an_unusual_one_stays_as_it_is() -> None:
    usual = {"material": "double-wide", "region": [0.0, 0.1, 0.5, 0.8]}
    thick = {"material": "blue-paint", "region": [0.5, 0.1, 0.5, 0.8]}
    kinetics = {"model": "trap_depths", "retrapping": 0.2, "optical_density": 1}
    truths = []
    for beside in (thick, {**thick, "kinetics": kinetics}):
        bench = Darkroom(sample=[usual, beside])
        bench.charge(300.0)
        truths.append((bench.room.truth().patches[0].states, bench.shoot(1.0, 400)[20:44, 4:40]))
    (expected, clean), (states, frame) = truths
    assert frame.mean() == pytest.approx(clean.mean(), rel=1e-4)
    for state, other in zip(states, expected, strict=True):
        assert state.k_r_per_s == other.k_r_per_s
        assert state.emission == other.emission
        assert state.concentration == pytest.approx(other.concentration, rel=1e-6)
        assert state.amplitude_dn_per_s == pytest.approx(other.amplitude_dn_per_s, rel=1e-6)


def test_the_kinetic_order_of_a_material_is_a_law_of_its_own(tmp_path: Path) -> None:
    state = read_material("blue-paint").states[0]
    path = tmp_path / "second.yaml"
    of_order = state.model_copy(update={"kinetic_order": 1.7})
    write_material(path, read_material("blue-paint").model_copy(update={"states": (of_order,)}))
    room: dict[str, object] = SMALL["sample"][0]
    by_settings = {**room, "kinetics": {"model": "general_order", "order": 1.7}}
    seen = []
    for patch in ({**room, "material": str(path)}, {**by_settings, "material": "blue-paint"}):
        bench = Darkroom(sample=[patch])
        bench.charge(60.0)
        (true,) = bench.room.truth(iso=400).patches[0].states
        seen.append((true.concentration, true.amplitude_dn_per_s, bench.shoot(1.0, 400).mean()))
    assert seen[0] == seen[1]
    with pytest.raises(UsageError, match="leave one of them out"):
        Darkroom(sample=[{**by_settings, "material": str(path)}])
