"""Broadband lamps in the simulated room: their light while their relays are closed."""

import numpy as np
import pytest

from labrig.sim.bench_settings import IlluminantSettings
from labrig.sim.lamp import BURNING_LIGHT, CELL_NM, WAVELENGTH_NM
from labrig.sim.lamps import Illuminants, illuminant_spectrum

KINDS = ("halogen", "xenon", "daylight", "ultraviolet")
LAMPS = tuple(
    IlluminantSettings.model_validate({"relay": relay, "kind": kind})
    for relay, kind in enumerate(KINDS)
)
PASSED = tuple(np.ones_like(WAVELENGTH_NM) for _ in LAMPS)


@pytest.mark.parametrize("lamp", LAMPS, ids=KINDS)
def test_a_lamp_has_its_light_and_its_colour(lamp: IlluminantSettings) -> None:
    spectrum = illuminant_spectrum(lamp)
    assert (spectrum >= 0).all()
    assert spectrum.sum() == pytest.approx(lamp.level * BURNING_LIGHT)
    mean_nm = np.average(WAVELENGTH_NM, weights=spectrum)
    expected_nm = {"halogen": 645, "xenon": 548, "daylight": 555, "ultraviolet": 369}[lamp.kind]
    assert mean_nm == pytest.approx(expected_nm, abs=8)


def test_a_lamp_warms_up_and_its_light_passes_its_filter_only() -> None:
    half = np.full_like(WAVELENGTH_NM, 0.5)
    bank = Illuminants(lamps=LAMPS, filters=(half, *PASSED[1:])).switched(0, True, 10.0)
    bank = bank.switched(7, True, 15.0).switched(0, False, 1010.0)
    light = bank.irradiance(np.array([9.0, 10.0, 1009.0, 1011.0]))
    full = half * illuminant_spectrum(LAMPS[0])
    assert not light[[0, 3]].any()
    np.testing.assert_allclose(light[1], 0.9 * full)
    np.testing.assert_allclose(light[2], full, rtol=1e-6)
    mean = bank.exposure(10.0, 1010.0) / 1000.0
    assert 0.99 < mean[100] / full[100] < 1.0
    assert CELL_NM * mean.sum() > 0
