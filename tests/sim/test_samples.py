"""Samples that are warmer, or turned away."""

from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.material import ScaleFactor, read_material, write_material
from labrig.sim.bench_settings import TemperatureSettings
from labrig.sim.lamp import WAVELENGTH_NM, Lamp
from labrig.sim.phosphor import Phosphor
from labrig.sim.simulation import LampSettings, Simulation
from labrig.sim.temperature import rate_factor
from tests.sim.darkroom import SMALL, Darkroom

STEADY = LampSettings(warm_up_deficit=0.0, drift_per_hour=0.0)
GLOWING = {"initial": {"concentration": 0.5}}


def test_re_radiation_more_than_doubles_in_ten_kelvin() -> None:
    """0.65 eV: 2.3 times from 21 to 31 °C."""
    faster = rate_factor(TemperatureSettings(start=31.0))
    assert faster(0.0) == pytest.approx(2.32, abs=0.01)
    drifting = rate_factor(TemperatureSettings(start=21.0, drift_per_hour=5.0))
    assert drifting(0.0) == pytest.approx(1.0, abs=1e-9)
    assert drifting(7200.0) == pytest.approx(faster(0.0))
    assert rate_factor(None)(1e6) == 1.0


def decay(**changed: object) -> tuple[float, float]:
    """Brightness now, and its rate over the next ten seconds."""
    bench = Darkroom(**{**GLOWING, **changed})
    first = bench.shoot(1.0, 100)[20:44].mean()
    bench.clock.spend(9.0)
    second = bench.shoot(1.0, 100)[20:44].mean()
    return float(first), float(np.log(first / second) / 10.0)


def test_a_warm_sample_glows_brighter_and_fades_faster() -> None:
    (cool, cool_rate), (warm, warm_rate) = decay(), decay(temperature={"start": 25.0})
    faster = rate_factor(TemperatureSettings(start=25.0))(0.0)
    assert cool_rate == pytest.approx(0.032, rel=0.02)
    assert warm_rate / cool_rate == pytest.approx(faster, rel=0.02)
    assert warm / cool == pytest.approx(faster * np.exp(-(warm_rate - cool_rate) / 2), rel=0.02)
    at_21, _ = decay(temperature={"start": 21.0})
    assert at_21 == pytest.approx(cool, rel=1e-3)


def test_the_truth_is_that_of_a_warm_room() -> None:
    bench = Darkroom(temperature={"start": 31.0})
    bench.charge(300.0)
    (state,) = bench.room.truth(iso=100).patches[0].states
    assert state.k_r_per_s == pytest.approx(0.032 * 2.32, rel=0.01)
    assert state.amplitude_dn_per_s is not None
    k = state.k_r_per_s
    expected = state.amplitude_dn_per_s[2] * (np.exp(-3 * k) - np.exp(-4 * k)) / k
    blue = bench.shoot(1.0, 100)[21:43:2, 41:55:2].mean()
    assert blue == pytest.approx(expected, rel=0.02)


def test_emission_is_isotropic_unless_it_is_reported_not_to_be() -> None:
    def tilted(degrees: int, **changed: object) -> float:
        bench = Darkroom(**{**GLOWING, **changed})
        bench.do(f"tilt {degrees}")
        return float(bench.shoot(1.0, 100)[20:44].mean())

    facing = tilted(0)
    assert tilted(60) == facing
    assert tilted(60, anisotropy=0.1) == pytest.approx(0.95 * facing, rel=1e-3)
    assert tilted(80, anisotropy=0.1) == pytest.approx((1 - 0.0826) * facing, rel=1e-3)


def test_the_truth_tells_what_a_patch_is_made_of() -> None:
    bench = Darkroom(sample="double-wide")
    (patch,) = bench.room.truth().patches
    assert patch.bands_nm is not None
    assert len(patch.states) == 2
    for state in patch.states:
        assert state.k_e_per_s is not None
        assert state.reradiation is not None
        assert len(state.k_e_per_s) == len(state.reradiation) == len(patch.bands_nm) - 1
        assert len(state.emission) == len(bench.room.truth().wavelength_nm)


@pytest.mark.parametrize("on", [False, True])
def test_warm_states_radiate_faster_in_the_dark_and_in_light(on: bool) -> None:
    row = np.zeros((1, len(WAVELENGTH_NM)))
    row[0, 100] = 0.02
    lamp = Lamp.found(STEADY, on)
    kappa = float(row[0] @ lamp.irradiance(1.0))
    warm = Phosphor(np.array([0.05]), row, np.array([0], dtype=np.intp), lambda _: 2.0)
    level, radiated = warm.evolve(np.array([0.5]), 0.0, 10.0, lamp)
    s, end = kappa + 0.1, kappa / (kappa + 0.1)
    assert level[0] == pytest.approx(end + (0.5 - end) * np.exp(-10 * s), rel=1e-6)
    integral = end * 10 + (0.5 - end) * (1 - np.exp(-10 * s)) / s
    assert radiated[0] == pytest.approx(2.0 * integral, rel=1e-6)


def test_a_room_that_is_opened_later_is_as_warm_as_it_has_become() -> None:
    warming = {"start": 20.0, "drift_per_hour": 2.0}
    room = Simulation.model_validate({**SMALL, "temperature": warming})
    later = room.opened_at(room.epoch.timestamp() + 5400.0)
    assert later.temperature is not None
    assert later.temperature.celsius(1800.0) == pytest.approx(24.0)


def test_a_material_on_the_lamps_scale_glows_as_its_lamp_lets_expect(tmp_path: Path) -> None:
    """Λ in s sr⁻¹: as many times the radiance of a white as its π Λ k_r r, both by one lamp."""
    paint = read_material("blue-paint")
    table = Darkroom().room.truth().patches[0].states[0].emission
    (state,) = paint.states
    scaled = paint.model_copy(update={"scale": "relative", "states": (
        state.model_copy(update={"reradiation": tuple(1e-3 * x for x in state.reradiation or ())}),
    )})  # fmt: skip
    sample = tmp_path / "sample.yaml"
    write_material(sample, scaled)
    patch = {"material": str(sample), "region": [0.0, 0.1, 1.0, 0.8]}
    bench = Darkroom(sample=[patch])
    emission = np.array(bench.room.truth().patches[0].states[0].emission)
    factor = emission.max() / max(table)
    np.testing.assert_allclose(emission, factor * np.array(table), rtol=1e-6)
    white = Darkroom(sample=[patch], lamp={"irradiance": 8.0})
    twice = np.array(white.room.truth().patches[0].states[0].emission)
    np.testing.assert_allclose(twice, 2 * emission)
    lit = ScaleFactor(name="by a reading in lux", value=0.5, unit="W/m²/nm")
    absolute = scaled.model_copy(update={"scale": "absolute", "scale_factors": (lit,)})
    write_material(sample, absolute)
    emission_absolute = np.array(
        Darkroom(sample=[patch]).room.truth().patches[0].states[0].emission
    )
    np.testing.assert_allclose(emission_absolute, 2 * emission)
    write_material(sample, absolute.model_copy(update={"scale_factors": ()}))
    with pytest.raises(UsageError, match="expected the lamp's mean spectral irradiance"):
        Darkroom(sample=[patch])


def test_lambda_of_a_white_that_glows_as_bright_as_it_reflects(tmp_path: Path) -> None:
    """Photographs: a glow of Λ k_r r = 1/π by the lamp's mean is as bright as a white there."""
    paint = read_material("blue-paint")
    (state,) = paint.states
    flat = state.model_copy(update={
        "reradiation": (1 / (np.pi * state.k_r_per_s * 0.5),) * 8, "k_e_per_s": None,
    })  # fmt: skip
    material = paint.model_copy(update={"scale": "relative", "states": (flat,)})
    write_material(tmp_path / "sample.yaml", material)
    bench = Darkroom(
        sample=[{"material": str(tmp_path / "sample.yaml"), "region": [0.0, 0.1, 1.0, 0.8]}],
        initial={"concentration": 0.5}, grey_card=0.9, lamp={"warm_up_deficit": 0.0},
    )  # fmt: skip
    glow = bench.shoot(1 / 2000, 100)[20:44].mean()
    bench.do("grey card")
    bench.room.switch_lamp(True)
    bench.clock.spend(60)
    card = bench.shoot(1 / 2000, 100)[20:44].mean()
    # The lamp is redder than the flat glow, and a camera sees its middle.
    assert glow / card * 0.9 == pytest.approx(1.0, abs=0.25)
