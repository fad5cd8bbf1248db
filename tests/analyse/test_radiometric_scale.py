"""The scale of a glow by a grey card: relative to the lamp, absolute by a reading in lux."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.bench_optics import card_reflectance, lamp_spectrum
from labrig.calibration import LVF_KIND, IrradianceFile
from labrig.fit.spectrum import CurveError, curve_modes
from labrig.material import read_material
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Strip,
    Transmittance,
    absolute_irradiance,
    read_camera,
)
from labrig.predict.glow import measured_amplitudes
from labrig.protocols.excitation.analysis.radiometric_scale import (
    RadiometricScale,
    mean_irradiance,
    scale_of,
)
from labrig.protocols.irradiance.analysis import analyse
from labrig.sim.lamp import BURNING_K, WAVELENGTH_NM, filament_spectrum
from labrig.sim.optics import REFLECTED, vignetting
from tests.analyse.recorded import part_of, record
from tests.analyse.spectral_bench import true_lvf_file
from tests.pulls import assert_sigma_is_right
from tests.sim.darkroom import Darkroom

WIDTH, HEIGHT = 192, 64
CAMERA = "canon_eos_5d_mark_ii"
BANDS_NM = (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("irradiance")
    on_sample = Strip(left=(0.08, 0.5), right=(0.92, 0.5), height=0.25, rising=False)
    calibrated = true_lvf_file(WIDTH, HEIGHT).model_copy(update={"on_sample": on_sample})
    LVF_KIND.write(folder, calibrated)

    def change(rig: dict[str, Any]) -> None:
        rig["optics"]["lvf"] = str(folder / "lvf.yaml")
        rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT, "curves": CAMERA}

    protocol = {"protocol": "irradiance", "longest": "4 s", "repeats": 1, "rounds": 1,
                "illuminance_lux": 1000}  # fmt: skip
    return record(folder, protocol, change)


@pytest.fixture(scope="module")
def irradiance(run: Path) -> IrradianceFile:
    return analyse(part_of(run)).calibration


def test_the_glow_over_the_lamps_light_is_the_rooms(run: Path, irradiance: IrradianceFile) -> None:
    part, card = part_of(run), irradiance.card
    assert card is not None
    bench = Darkroom(
        sample=[{"material": "blue-paint", "region": [0.03, 0.1, 0.94, 0.8]}],
        lens={"name": "EF75mm", "focal_mm": 75},
        sensor={"width": WIDTH, "height": HEIGHT, "flicker": 0.0, "curves": CAMERA},
    )
    bench.charge(900)
    (state,) = bench.room.truth(iso=100, f_number=4.0).patches[0].states
    assert state.amplitude_dn_per_s is not None
    assert state.concentration is not None
    radiance = np.array(state.emission) * state.k_r_per_s * state.concentration
    in_bands = (BANDS_NM[0] < WAVELENGTH_NM) & (BANDS_NM[-1] > WAVELENGTH_NM)
    white = REFLECTED * bench.simulation.lamp.irradiance * filament_spectrum(BURNING_K)
    expected = radiance.max() / (np.pi * white[in_bands].mean())
    # The card is read along the strip, where the lens is darker than in its middle.
    seen = vignetting(HEIGHT, WIDTH, 75)[24:40, 16:176].mean()
    for channel, name in ((1, "G"), (2, "B")):
        factors = scale_of(
            card,
            read_camera(CAMERA),
            name,
            lamp_spectrum(part.rig),
            card_reflectance(part.rig),
            Spectrum("glow", WAVELENGTH_NM, radiance / radiance.max()),
            irradiance.bands_nm,
        )
        found = RadiometricScale("relative", factors).value * state.amplitude_dn_per_s[channel]
        assert found * seen == pytest.approx(expected, rel=0.03)


def test_curves_of_another_body_are_in_the_sigma(irradiance: IrradianceFile) -> None:
    house, error = read_camera(CAMERA), CurveError()
    nm, curve = house.wavelength_nm, house.sensitivity
    modes = curve_modes(error, nm, curve, curve.max(axis=0))
    rng = np.random.default_rng(5)
    flat = Spectrum("flat", np.array([380.0, 780.0]), np.array([1.0, 1.0]))
    glow = Spectrum("glow", np.array([440.0, 480.0, 520.0]), np.array([0.0, 1.0, 0.0]))
    grey = Transmittance("grey", np.array([380.0, 780.0]), np.full(2, 0.18), np.full(2, 1e-9))
    assert irradiance.card is not None
    card = irradiance.card.model_copy(update={"sigma_dn_per_s": (0.0, 0.0, 0.0)})

    def scale(camera: CameraResponse) -> RadiometricScale:
        factors = scale_of(card, camera, "B", flat, grey, glow, BANDS_NM)
        return RadiometricScale("relative", factors)

    stated, pulls = scale(house), []
    for _ in range(300):
        changed = curve + sum(rng.standard_normal() * mode for mode in modes)
        found = scale(replace(house, sensitivity=changed))
        pulls.append((found.value / stated.value - 1) / stated.relative_sigma)
    assert_sigma_is_right(pulls)


def test_the_factors_multiply_and_their_sigmas_add_in_quadrature() -> None:
    state = (
        read_material("blue-paint")
        .states[0]
        .model_copy(
            update={"amplitude": 100.0, "amplitude_sigma": 3.0, "reradiation_sigma": (0.0,) * 8}
        )
    )
    material = read_material("blue-paint").model_copy(update={"states": (state,)})
    lamp = Spectrum("flat", np.array([380.0, 780.0]), np.array([1.0, 1.0]))
    absolute = mean_irradiance(1000.0, 40.0, lamp, BANDS_NM)
    scale = RadiometricScale("absolute", (absolute, absolute))
    scaled = scale.of(material)
    (after,) = scaled.states
    assert scaled.scale == "absolute"
    assert after.amplitude == pytest.approx(100 * absolute.value**2)
    assert after.amplitude_sigma == pytest.approx(
        after.amplitude * np.sqrt(0.03**2 + 2 * 0.04**2), rel=1e-6
    )
    assert after.reradiation_sigma == pytest.approx(
        np.array(after.reradiation) * np.sqrt(2) * 0.04, rel=1e-6
    )
    # Predictions count photons: they go back by the same factors.
    counts = measured_amplitudes(scaled)
    assert counts == pytest.approx([100.0])


def test_a_reading_in_lux_gives_watts() -> None:
    """An equal-energy spectrum of 1 W m⁻² nm⁻¹ has 683 lm/W times the area of V(λ), 106.86 nm."""
    nm = np.arange(360.0, 831.0, 5.0)
    lamp = absolute_irradiance(683 * 106.86, Spectrum("equal", nm, np.full_like(nm, 7.0)))
    assert lamp.value == pytest.approx(np.ones_like(nm), rel=2e-3)


def test_the_reading_and_the_cards_light_are_in_the_file(irradiance: IrradianceFile) -> None:
    assert (irradiance.illuminance_lux, irradiance.illuminance_lux_sigma) == (1000, 50)
    assert irradiance.card is not None
    assert irradiance.card.channels == ("R", "G", "B")
    relative = np.array(irradiance.card.sigma_dn_per_s) / irradiance.card.dn_per_s
    assert (relative < 0.01).all()
    assert (relative > 0.003).all()
