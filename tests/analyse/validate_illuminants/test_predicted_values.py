"""σ of predicted values, against what bench, card and matrix really are."""

from dataclasses import replace

import numpy as np

from labrig.analyse.lit_patches import CARD_COURSE, CARD_SIGMA, LitPatch, exposure_of
from labrig.bench_optics import LightSource
from labrig.fit.fluorescence import FluorescenceSystem, fluorescence_system
from labrig.fit.leds import CURVES_OF_MODEL
from labrig.material import ReradiationMatrix
from labrig.optics import Transmittance, read_camera, read_light
from labrig.protocols.validate_illuminants.analysis.prediction import predicted_values
from tests.pulls import assert_sigma_is_right

CAMERA = read_camera("canon_eos_5d_mark_ii")
WHITE = Transmittance("card", np.array([300.0, 800.0]), np.full(2, 0.18))
INPUT_NM, OUTPUT_NM = np.arange(300.0, 781.0, 20.0), np.arange(380.0, 781.0, 20.0)
NOISE = 0.003
FLICKER = 0.002
DRAWS = 40


def lamp(name: str) -> LightSource:
    return LightSource(read_light(name), 1.0, np.inf, 0.0, is_lamp=True)


def surface() -> ReradiationMatrix:
    reflectance = 0.2 + 0.4 / (1 + np.exp(-(OUTPUT_NM - 520) / 25))
    emission = np.exp(-(((OUTPUT_NM - 530) / 28) ** 2) / 2)
    excitation = np.exp(-(((INPUT_NM - 450) / 45) ** 2) / 2)
    dye = 0.006 * np.outer(emission, excitation) * (OUTPUT_NM[:, np.newaxis] > INPUT_NM)
    return ReradiationMatrix("dye", INPUT_NM, OUTPUT_NM, reflectance, dye)


def seen(
    system: FluorescenceSystem, z: np.ndarray, reflectance: np.ndarray, dye: np.ndarray
) -> np.ndarray:
    """Values on a bench whose lamps and curves are off by z."""
    response, modes = system.response, system.modes
    reflected = response.reflected + np.tensordot(z, modes.reflected, 1)
    absorbed = response.absorbed + np.tensordot(z, modes.absorbed, 1)
    through = response.seen + np.tensordot(z, modes.seen, 1)
    return np.asarray(reflected @ reflectance + absorbed @ dye.T @ through)


def root_of(correlation_nm: float) -> np.ndarray:
    """A root of the correlation of errors at the output wavelengths."""
    off = (OUTPUT_NM[:, np.newaxis] - OUTPUT_NM) / correlation_nm
    return np.linalg.cholesky(np.exp(-(off**2) / 2) + 1e-9 * np.eye(len(OUTPUT_NM)))


def lit(value: np.ndarray, rng: np.random.Generator) -> LitPatch:
    sigma = NOISE * value
    nothing = np.zeros_like(value)
    noisy = value + sigma * rng.standard_normal(value.shape)
    no = np.zeros(len(value), dtype=np.bool_)
    shutter = FLICKER * rng.standard_normal((len(value), 1))
    variance = sigma**2 + np.square(FLICKER * value)
    flicker = np.full(len(value), FLICKER)
    return LitPatch(noisy * (1 + shutter), variance, nothing, nothing + 1, no, no, flicker)


def test_pulls_are_those_of_unit_deviations() -> None:
    rng = np.random.default_rng(2)
    lamps = [lamp("D65"), lamp("A")]
    system = fluorescence_system(
        [exposure_of(each) for each in lamps], CAMERA, CURVES_OF_MODEL, INPUT_NM, OUTPUT_NM
    )
    true = surface()
    root, of_card = root_of(60.0), root_of(CARD_COURSE.correlation_nm)
    sigma = np.full(len(OUTPUT_NM), 0.02)
    card = WHITE.at(OUTPUT_NM)
    pulls = []
    for _ in range(DRAWS):
        z = rng.standard_normal(len(system.modes.reflected))
        course = CARD_COURSE.relative * (of_card @ rng.standard_normal(len(OUTPUT_NM)))
        whiter = card * (1 + CARD_SIGMA * rng.standard_normal() + course)
        light = 1e5 * rng.uniform(0.5, 2.0, (2, 1))
        white = lit(light * seen(system, z, whiter, np.zeros_like(true.reradiation)), rng)
        sample = lit(light * seen(system, z, true.reflectance, true.reradiation), rng)
        found = replace(
            true,
            reflectance=true.reflectance + sigma * (root @ rng.standard_normal(len(sigma))),
            reflectance_sigma=sigma,
            reradiation_sigma=np.zeros_like(true.reradiation),
        )
        predicted = predicted_values(found, lamps, CAMERA, WHITE, white)
        covariance = predicted.covariance + sample.covariance
        residual = sample.value - predicted.whole
        pulls.append(np.einsum("mk,mkl,ml->m", residual, np.linalg.inv(covariance), residual) / 3)
    assert_sigma_is_right(np.sqrt(pulls))
