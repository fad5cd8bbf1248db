"""The absolute scale of the simulated room."""

import numpy as np
import pytest

from labrig.optics import photopic_efficacy
from labrig.sim.lamp import BURNING_SPECTRUM, WAVELENGTH_NM
from labrig.sim.optics import PHOTOPIC, REFLECTED, luminance_mcd_per_m2
from labrig.sim.simulation import LampSettings
from tests.sim.darkroom import Darkroom


def test_a_white_under_the_lamp_has_the_luminance_of_its_illuminance() -> None:
    lamp = LampSettings(illuminance=500.0, irradiance=2.0)
    white = REFLECTED * lamp.irradiance * BURNING_SPECTRUM
    assert luminance_mcd_per_m2(white, lamp) == pytest.approx(1000 * 500 / np.pi)
    assert pytest.approx(photopic_efficacy(WAVELENGTH_NM), abs=3.5) == 683 * PHOTOPIC


def test_the_luminance_of_a_glow_is_in_proportion_to_its_brightness() -> None:
    light = []
    for brightness in (1.0, 3.0):
        sample = {"material": "power-law", "region": [0.0, 0.0, 1.0, 1.0], "brightness": brightness}
        bench = Darkroom(sample=[sample])
        bench.charge(60.0)
        light.append(bench.room.true_luminance(bench.clock.now()))
    assert light[1] == pytest.approx(3 * light[0])
    assert light[0].shape == (1,)
