"""The system of lights and camera, its white reference, bad input, and the fit light by light."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.fit.fluorescence import (
    Exposure,
    FluorescenceSystem,
    JointEstimator,
    fit_fluorescence,
    fit_per_led,
    fluorescence_system,
    predicted_colour,
)
from labrig.fit.spectrum import CurveError
from labrig.foundation.errors import UsageError
from labrig.material import appearance
from labrig.optics import CameraResponse, Spectrum, Transmittance, read_camera, read_light
from tests.fit.fluorescent_samples import (
    CAMERA,
    CENTRES_NM,
    FEW_NM,
    INPUT_NM,
    OUTPUT_NM,
    Dye,
    led,
    lights,
    photographed,
    smooth_reflectance,
    surface,
    system_of,
)
from tests.pulls import assert_sigma_is_right

EVEN = np.full(len(OUTPUT_NM), 0.4)
GREEN = Dye(0.4, 450, 510)
WHITE = np.ones(len(OUTPUT_NM))
#: Relative change of lights between card and surface.
FLICKER = 0.007
DARK = np.zeros((len(OUTPUT_NM), len(INPUT_NM)))


def test_values_are_the_integral_of_light_surface_and_curve() -> None:
    system = system_of(lights())
    camera, nm = read_camera(CAMERA), np.arange(320.0, 800.0, 0.1)
    light = led(CENTRES_NM[2]).at(nm)
    light /= light.sum() * 0.1
    reflectance = np.interp(nm, OUTPUT_NM, np.linspace(0.1, 0.8, len(OUTPUT_NM)))
    reflected = 0.1 * (reflectance * light) @ camera.at(nm)
    emitted = np.interp(nm, [549.95, 550, 570, 570.05], [0, 0.01, 0.01, 0])
    absorbed = 0.1 * light[(nm > 430) & (nm < 450)].sum()
    dye = DARK.copy()
    dye[OUTPUT_NM == 560, INPUT_NM == 440] = 0.01
    value = system.values(np.linspace(0.1, 0.8, len(OUTPUT_NM)), dye)[2]
    assert_allclose(value, reflected + absorbed * (0.1 * emitted @ camera.at(nm)), rtol=0.02)


def test_a_white_tells_brightnesses_and_wavelengths() -> None:
    rng = np.random.default_rng(1)
    shifts, brightness = rng.normal(0, 1, len(CENTRES_NM)), np.exp(rng.normal(0, 1, 9))
    real = system_of(lights((np.array(CENTRES_NM) + shifts).tolist()))
    scale = brightness[:, np.newaxis]

    def shot(matrix_scale: float, *dyes: Dye) -> tuple[np.ndarray, np.ndarray]:
        value, variance = photographed(real, surface(matrix_scale * WHITE, *dyes), rng)
        return scale * value, scale**2 * variance

    told = fluorescence_system(
        [Exposure(led(nm), 1.0, math.inf, 1.0) for nm in CENTRES_NM],
        read_camera(CAMERA), CurveError(0.01, 0.001), INPUT_NM, OUTPUT_NM,
    )  # fmt: skip
    card = Transmittance("card", np.array([300.0, 800.0]), np.array([0.9, 0.9]))
    informed = told.informed_by_white(*shot(0.9), card)
    assert told.is_loose.all()
    assert not informed.is_loose.any()
    assert_allclose(informed.brightness / brightness, 1, atol=0.08)
    # Errors that a white has, too, are known; its σ is what is left of them all.
    grey = informed.covariance(EVEN, DARK)
    assert_allclose(np.sqrt(np.diag(grey)), 0, atol=0.005)
    with_sigma = told.informed_by_white(*shot(0.9), card, 0.02)
    added = with_sigma.covariance(EVEN, DARK)
    sigma = np.sqrt(np.diag(added)).reshape(9, 3)[4] / informed.values(EVEN, DARK)[4]
    assert_allclose(sigma, 0.02, rtol=0.25)

    fit = fit_fluorescence("green", *shot(0.4, GREEN), informed)
    colour = predicted_colour(fit, read_light("A"))
    exact = predicted_colour(
        fit_fluorescence("", *photographed(real, surface(EVEN, GREEN), rng), real), read_light("A")
    )
    assert (np.abs(colour.lab - exact.lab) < 3 * np.hypot(colour.lab_sigma, exact.lab_sigma)).all()


def benches(
    count: int,
) -> Iterator[tuple[FluorescenceSystem, FluorescenceSystem, np.random.Generator]]:
    """Benches as they are and as they are told by a card, and generators of what is done there.

    LEDs are told by peak and width and are lopsided, the card's file is wrong by a wave.
    """
    for seed in range(count):
        rng = np.random.default_rng(seed)
        told, real = [], []
        for nm in FEW_NM:
            width, skew = 11 * np.exp(0.2 * rng.standard_normal()), rng.normal(0, 0.2)
            off = np.arange(-60.0, 61.0)
            shape = np.exp(-((off / (width * (1 + skew * np.sign(off)))) ** 2) / 2)
            shifted = nm + 1.5 * rng.standard_normal() + off
            real.append(Exposure(Spectrum(f"{nm:g} nm", shifted, shape)))
            normal = Spectrum(f"{nm:g} nm", nm + off, np.exp(-((off / 11) ** 2) / 2))
            told.append(Exposure(normal, 1.0, math.inf, 1.5, 0.2, 0.2))
        truth = system_of(real)
        wave = np.sin((OUTPUT_NM + rng.uniform(0, 300)) / 50)
        card = 0.9 * (1 + 0.01 * rng.standard_normal() + 0.014 * wave)
        value, variance = photographed(truth, surface(card), rng)
        flat = Transmittance("card", np.array([300.0, 800.0]), np.array([0.9, 0.9]))
        course = CurveError(0.01, 0.0, 100.0)
        system = system_of(told).informed_by_white(value, variance, flat, 0.01, course)
        yield truth, system.with_drift(np.full(len(FEW_NM), FLICKER)), rng


@pytest.mark.campaign
def test_errors_of_a_bench_are_in_sigma() -> None:
    lamps, pulls = [read_light("D65"), read_light("A")], []
    for truth, system, rng in benches(12):
        estimator = JointEstimator(system)
        for _ in range(2):
            emitted_nm = rng.uniform(440, 620)
            dye = Dye(rng.uniform(0.1, 0.6), emitted_nm - rng.uniform(30, 60), emitted_nm)
            real = surface(0.8 * smooth_reflectance(rng), dye)
            value, variance = photographed(truth, real, rng, 0.001)
            flicker = 1 + FLICKER * rng.standard_normal((len(FEW_NM), 1))
            fit = estimator.fit("", flicker * value, variance)
            for lamp in lamps:
                colour = predicted_colour(fit, lamp)
                pulls.append((colour.lab - appearance(real, lamp).lab) / colour.lab_sigma)
    assert_sigma_is_right(pulls)


def flat_camera() -> CameraResponse:
    nm = np.array([900.0, 1000.0, 1100.0])
    return CameraResponse("infrared", nm, np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0.0]]))


def call(change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]) -> None:
    system = system_of(lights())
    value, variance = photographed(system, surface(EVEN), np.random.default_rng(0))
    fit_fluorescence("bad", *change(value, variance), system)


def changed(array: np.ndarray, number: float) -> np.ndarray:
    array = array.copy()
    array[3, 1] = number
    return array


BAD: dict[str, tuple[Callable[[], object], str]] = {
    "shape": (
        lambda: call(lambda y, v: (y[:-1], v[:-1])),
        r"expected values of 9 lights and 3 channels, shape \(9, 3\), got \(8, 3\)",
    ),
    "missing": (
        lambda: call(lambda y, v: (changed(y, np.nan), v)),
        r"light '475 nm': expected a finite value of every channel",
    ),
    "negative variance": (
        lambda: call(lambda y, v: (y, changed(v, -1.0))),
        r"light '475 nm': expected variances above 0",
    ),
    "one light": (
        lambda: JointEstimator(system_of(lights()[:1])),
        r"expected two or more lights, got 1",
    ),
    "camera elsewhere": (
        lambda: fluorescence_system(lights(), flat_camera()),
        r"camera 'infrared': expected curves between 375 and 785 nm, got 900 to 1100 nm",
    ),
    "light elsewhere": (
        lambda: system_of([*lights(), Exposure(led(900.0))]),
        r"light '900 nm': expected its power from 290 to 790 nm",
    ),
    "brightness": (
        lambda: Exposure(led(450.0), 0.0),
        r"light '450 nm': expected a brightness above 0, got 0.0",
    ),
    "brightness sigma": (
        lambda: Exposure(led(450.0), 1.0, -0.1),
        r"light '450 nm': expected brightness_sigma of 0 or more, got -0.1",
    ),
    "shift": (
        lambda: Exposure(led(450.0), wavelength_sigma_nm=math.inf),
        r"light '450 nm': expected a finite wavelength_sigma_nm",
    ),
    "no scale": (
        lambda: JointEstimator(
            system_of([replace(light, brightness_sigma=math.inf) for light in lights()])
        ),
        r"expected one light or more of known brightness, got none",
    ),
    "no light": (
        lambda: Exposure(Spectrum("none", INPUT_NM, 0 * INPUT_NM)),
        r"light 'none': expected a spectrum above 0",
    ),
    "method": (
        lambda: fit_fluorescence("", EVEN, EVEN, system_of(lights()), method="best"),  # type: ignore[arg-type]
        r"expected the method joint or per-led, got 'best'",
    ),
}


@pytest.mark.parametrize("case", BAD, ids=lambda case: case)
def test_bad_input_is_told_in_one_line(case: str) -> None:
    act, message = BAD[case]
    with pytest.raises(UsageError, match=message) as caught:
        act()
    assert "\n" not in str(caught.value)


def test_each_light_by_itself_keeps_to_the_boxes_of_the_thesis() -> None:
    system = system_of(lights())
    value, variance = photographed(system, surface(EVEN, GREEN), np.random.default_rng(2))
    fit = fit_per_led("green", value, variance, system)
    (dye,) = fit.fluorophores
    emission = dye.emission.value / dye.emission.value.sum()
    mean_nm = float(emission @ OUTPUT_NM)
    sigma_nm = float(np.sqrt(emission @ (OUTPUT_NM - mean_nm) ** 2))
    assert mean_nm > CENTRES_NM[0] + 15
    assert 7 < sigma_nm < 43
    assert (fit.matrix.reradiation >= 0).all()
    assert not fit.matrix.reradiation[~fit.matrix.is_stokes].any()
    assert fit.surfaces is None
    assert math.isnan(fit.reduced_chi2)
    with pytest.raises(UsageError, match="expected an estimate with its uncertainty"):
        predicted_colour(fit, read_light("A"))


def test_each_light_by_itself_finds_a_reflectance_on_its_scale() -> None:
    system = system_of(lights())
    value = 3.0 * system.values(EVEN, DARK)
    brighter = system_of([replace(light, brightness=3.0) for light in lights()])
    fit = fit_per_led("grey", value, np.full_like(value, 1e-6), brighter)
    lit = (OUTPUT_NM > 440) & (OUTPUT_NM < 620)
    assert_allclose(np.median(fit.matrix.reflectance[lit]), 0.4, rtol=0.2)
