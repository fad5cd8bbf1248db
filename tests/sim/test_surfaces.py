"""Fluorescent samples in the simulated room: light in, light out, frames of them."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.material import Albedo, ReradiationMatrix, read_material, write_reradiation
from labrig.sim.bench_settings import LedSettings
from labrig.sim.lamp import CELL_NM, WAVELENGTH_NM
from labrig.sim.leds import Leds, led_spectrum
from labrig.sim.optics import emission, film, glass
from labrig.sim.surfaces import Surfaces, reradiation_on_grid
from tests.sim.darkroom import Darkroom, colours

INPUT_NM, OUTPUT_NM = np.arange(300.0, 781, 10), np.arange(380.0, 781, 10)


def dye(yield_fraction: float = 0.4) -> ReradiationMatrix:
    """Excited around 450 nm, emitting around 560 nm, on a surface that reflects 30 %."""
    excitation = np.exp(-(((INPUT_NM - 450) / 30) ** 2))
    emission = np.exp(-(((OUTPUT_NM - 560) / 35) ** 2))
    emission /= emission.sum()
    values = yield_fraction * np.outer(emission, excitation)
    values[OUTPUT_NM[:, np.newaxis] <= INPUT_NM] = 0
    mirror = 0.3 * (OUTPUT_NM[:, np.newaxis] == INPUT_NM)
    return ReradiationMatrix.from_bands("dye", INPUT_NM, OUTPUT_NM, values + mirror)


def narrow(nm: float) -> np.ndarray:
    """A light of 20 nm with an integral of 1."""
    light = np.exp(-(((WAVELENGTH_NM - nm) / 12) ** 2))
    return np.asarray(light / (light.sum() * CELL_NM))


@pytest.mark.parametrize("nm", [420.0, 450.0, 480.0])
def test_the_light_that_comes_back_is_the_matrix_times_the_light(nm: float) -> None:
    matrix, light = dye(), narrow(nm)
    back = Surfaces([matrix], gloss=0.0).thrown_back(light, np.array([0, 1]))
    assert not back[0].any()
    reradiated = (back[1] - 0.3 * light).sum() * CELL_NM
    fraction = np.interp(WAVELENGTH_NM, INPUT_NM, matrix.reradiated_fraction) @ light * CELL_NM
    assert_allclose(reradiated, fraction, rtol=0.02)
    far = nm + 50 < WAVELENGTH_NM
    mean_nm = np.average(WAVELENGTH_NM[far], weights=back[1][far])
    assert mean_nm == pytest.approx(562, abs=5)


def test_nothing_comes_back_at_shorter_wavelengths() -> None:
    grid = reradiation_on_grid(dye())
    assert not grid[WAVELENGTH_NM[:, np.newaxis] <= WAVELENGTH_NM].any()
    assert (grid >= 0).all()


def test_gloss_mirrors_and_a_phosphor_reflects_half() -> None:
    light = narrow(500)
    surfaces = Surfaces([dye(0.0), read_material("blue-paint")], gloss=0.04)
    back = surfaces.thrown_back(light, np.array([1, 2]))
    assert_allclose(back, np.array([[0.3], [0.5]]) * light)
    mirrored = surfaces.mirrored(light, np.array([0, 1, 2]))
    assert_allclose(mirrored, np.array([[0.0], [0.04], [0.04]]) * light)


def test_a_phosphor_reflects_its_albedo_and_fluoresces_in_the_colour_of_its_glow() -> None:
    albedo = Albedo(wavelength_nm=(400.0, 600.0), value=(0.2, 0.6))
    paint = read_material("blue-paint").model_copy(update={"albedo": albedo})
    light, patch = narrow(440), np.array([1])
    plain = Surfaces([paint], 0.0).thrown_back(light, patch)
    assert_allclose(plain[0], np.interp(WAVELENGTH_NM, [400, 600], [0.2, 0.6]) * light)
    surfaces = Surfaces([paint], 0.0, [0.1])
    assert_allclose(surfaces.reflected(light, patch), plain)
    prompt = surfaces.reradiated(light, patch)[0]
    glow = emission(paint)[0]
    assert_allclose(prompt / prompt.sum(), glow / glow.sum(), atol=1e-9)
    # Excited nearly as well as it can be, by the light that is not reflected.
    assert 0.04 < prompt.sum() / light.sum() < 0.1 * (1 - 0.28)
    assert surfaces.reradiated(narrow(600), patch).sum() < 1e-3 * prompt.sum()


def test_a_lit_sample_shows_itself_on_the_closed_door() -> None:
    bench = Darkroom(door={"channel": 0})
    bench.do("grey card")
    bench.room.switch_lamp(True)
    bench.clock.spend(600)
    card = colours(bench.shoot(1 / 500, 100))[16, 24]
    bench.do("lit sample")
    bench.clock.spend(600)
    sample = colours(bench.shoot(1 / 500, 100))[16, 24]
    assert_allclose(sample / card, 0.5 / 0.18, rtol=0.05)
    bench.room.switch_lamp(False)
    bench.clock.spend(0.6)
    assert colours(bench.shoot(1.0, 400))[16, 24].max() > 500
    bench.do("sample")
    assert colours(bench.shoot(1.0, 400))[16, 24].max() < 20


@pytest.mark.parametrize(
    ("light_deg", "polarisers", "mirrored"),
    [(0, None, 1.0), (10, None, 0.59), (45, None, 0.0), (0, "crossed", 0.0), (45, "crossed", 0.0)],
)
def test_gloss_stays_away_at_45_degrees_and_behind_crossed_polarisers(
    tmp_path: Path, light_deg: int, polarisers: str | None, mirrored: float
) -> None:
    write_reradiation(tmp_path / "plain.csv", dye(0.0))

    def green(gloss: float) -> float:
        bench = Darkroom(
            sample=[{"material": str(tmp_path / "plain.csv"), "region": [0.0, 0.0, 1.0, 1.0]}],
            leds=[{"relay": 1, "centre": 530, "fwhm": 30, "level": "2 %"}],
            light_deg=light_deg, polarisers=polarisers, gloss=gloss,
            sensor={"width": 96, "height": 64, "flicker": 0.0},
        )  # fmt: skip
        bench.room.switch_led(1, True)
        seen = colours(bench.shoot(1 / 100, 100 if polarisers is None else 400))
        return float(seen.mean(axis=(0, 1))[1])

    # Of 30 % that the surface reflects diffusely, more where the light is steeper.
    sheen = np.exp((45 - light_deg) / 60)
    assert green(0.1) / green(0.0) - 1 == pytest.approx(mirrored * 0.1 / (0.3 * sheen), abs=0.006)


def test_polarisers_and_the_lens_take_ultraviolet_and_more_than_half_of_other_light() -> None:
    passed = film("crossed")
    blue, green = (int(np.argmin(abs(WAVELENGTH_NM - nm))) for nm in (370.0, 550.0))
    assert passed[blue] < 0.02 < passed[green] < 0.5
    lens = glass(390.0)
    assert np.interp([375.0, 390.0, 420.0], WAVELENGTH_NM, lens) == pytest.approx(
        [0.0, 0.5, 1.0], abs=0.03
    )
    led = LedSettings(relay=1, centre=450)
    bank = Leds((led,), passed=passed).switched(1, True, 1.0)
    assert_allclose(bank.irradiance(2.0), passed * led_spectrum(led))
    assert (film(None) == 1).all()
    assert (glass(None) == 1).all()


def test_a_frame_shows_the_fluorescent_light(tmp_path: Path) -> None:
    write_reradiation(tmp_path / "dye.csv", dye())
    write_reradiation(tmp_path / "plain.csv", dye(0.0))
    bench = Darkroom(
        sample=[
            {"material": str(tmp_path / "dye.csv"), "region": [0.0, 0.0, 0.5, 1.0]},
            {"material": str(tmp_path / "plain.csv"), "region": [0.5, 0.0, 0.5, 1.0]},
        ],
        leds=[{"relay": 1, "centre": 450, "fwhm": 20}],
    )
    bench.room.switch_led(1, True)
    dyed, plain = np.split(colours(bench.shoot(1 / 30, 100)), 2, axis=1)
    red, green, blue = dyed.mean(axis=(0, 1)) / plain.mean(axis=(0, 1))
    assert blue == pytest.approx(1.0, abs=0.1)
    assert green > 2
    assert red > 2
    bench.room.switch_led(1, False)
    dark = bench.shoot(1.0, 100)
    assert dark.mean() == pytest.approx(0.0, abs=2)
    assert [patch.states for patch in bench.room.truth().patches] == [(), ()]


def test_leds_droop_and_shift_as_they_warm() -> None:
    led = LedSettings.model_validate(
        {"relay": 1, "centre": 450, "droop": 0.1, "shift_nm": 4, "warm_up": "20 s"}
    )
    bank = Leds((led,)).switched(1, True, 10.0)
    cold, warm = bank.irradiance(10.0), bank.irradiance(1000.0)
    assert warm.sum() == pytest.approx(0.9 * cold.sum(), rel=1e-3)
    centres = [np.average(WAVELENGTH_NM, weights=light) for light in (cold, warm)]
    assert centres[1] - centres[0] == pytest.approx(4.0, abs=0.1)
    fractions = bank.irradiance(np.array([30.0])).sum() / cold.sum()
    assert fractions == pytest.approx(1 - 0.1 * (1 - np.exp(-1)), rel=1e-3)
    # Off as long as it was on: it has not become cold again.
    again = bank.switched(1, False, 30.0).switched(1, True, 50.0)
    start = 1 - 0.1 * (1 - np.exp(-1)) * np.exp(-1)
    assert again.irradiance(50.0).sum() / cold.sum() == pytest.approx(start, rel=1e-3)
    times_s = np.linspace(12.0, 80.0, 6801)
    expected = np.trapezoid(again.irradiance(times_s), times_s, axis=0)
    assert_allclose(again.exposure(12.0, 80.0), expected, rtol=2e-4, atol=1e-6)


def test_a_lopsided_led_keeps_peak_and_width() -> None:
    spectrum = led_spectrum(LedSettings(relay=1, centre=500, fwhm=30, asymmetry=2.0))
    half = WAVELENGTH_NM[spectrum > spectrum.max() / 2]
    assert WAVELENGTH_NM[spectrum.argmax()] == pytest.approx(500, abs=1.3)
    assert half[-1] - half[0] == pytest.approx(30, abs=2.6)
    assert np.average(WAVELENGTH_NM, weights=spectrum) > 504


def test_a_measured_led_has_the_spectrum_of_its_file(tmp_path: Path) -> None:
    file = tmp_path / "led.csv"
    file.write_text("wavelength_nm,value\n440,0\n450,1\n470,0.5\n480,0\n")
    spectrum = led_spectrum(LedSettings(relay=1, centre=450, spectrum=str(file)))
    expected = np.interp(WAVELENGTH_NM, [440, 450, 470, 480], [0, 1, 0.5, 0])
    assert_allclose(spectrum / spectrum.sum(), expected / expected.sum())
