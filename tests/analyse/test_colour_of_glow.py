"""Luminances from three channels, with the simulated camera's own curves as the truth."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from labrig.acquire import RigFile, read_rig_file
from labrig.bench_optics import (
    bare_lamp_spectrum,
    camera_curves,
    card_radiance,
    card_reflectance,
    luminance,
)
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.optics import Spectrum, photopic_efficacy, scotopic_efficacy
from labrig.protocols.luminance.analysis.colour_of_glow import ColourScale, Emission, colour_scale
from labrig.sim.cards import reflectances
from labrig.sim.lamp import BURNING_SPECTRUM, CELL_NM, WAVELENGTH_NM
from labrig.sim.optics import CameraCurves, bent_curves, measured_curves
from tests.pulls import assert_sigma_is_right

NM = np.arange(380.0, 721.0, 5.0)
NOISE = 0.002


@cache
def rig() -> RigFile:
    return read_rig_file(resources.folder("config") / "sim-luminance.yaml")


@dataclass(frozen=True)
class Found:
    """Scale that the colour gave, and luminance and card relative to the true ones."""

    scale: ColourScale
    luminance: float
    scotopic_ratio: float
    card: FloatArray

    @property
    def pull(self) -> float:
        return (self.luminance - 1) / self.scale.relative_sigma


def band(nm: FloatArray, middle_nm: float, fwhm_nm: float) -> FloatArray:
    return np.asarray(np.exp(-4 * np.log(2) * ((nm - middle_nm) / fwhm_nm) ** 2))


def found(
    middle_nm: float, fwhm_nm: float, curves: CameraCurves, *, known: bool, seed: int = 0
) -> Found:
    """A glow of one band, and the card under the room's lamp, as a camera of these curves."""
    glow = band(WAVELENGTH_NM, middle_nm, fwhm_nm)
    lux = CELL_NM * BURNING_SPECTRUM @ photopic_efficacy(WAVELENGTH_NM)
    card = reflectances("grey card", 0.18)[1] * BURNING_SPECTRUM * 1000 / lux / np.pi
    ratio = curves.sensitivity @ glow / (curves.sensitivity @ card)
    ratio *= 1 + NOISE * np.random.default_rng(seed).standard_normal(3)
    norm = ratio.max()
    emission = Emission(Spectrum("band", NM, band(NM, middle_nm, fwhm_nm)), "band", 0.02)
    scale = colour_scale(
        ratio / norm,
        NOISE * ratio / norm,
        camera_curves(rig()),
        card_radiance(rig()),
        bare_lamp_spectrum(rig()),
        card_reflectance(rig()),
        emission if known else None,
    )
    seen = CELL_NM * glow @ photopic_efficacy(WAVELENGTH_NM)
    scotopic = CELL_NM * glow @ scotopic_efficacy(WAVELENGTH_NM)
    shown = float(scale.weights @ ratio / seen)
    return Found(scale, shown, float(scotopic / seen), curves.sensitivity @ card)


def test_with_exact_curves_the_luminance_is_exact() -> None:
    assert luminance(card_radiance(rig())) == pytest.approx(0.18 * 1000 / np.pi, rel=0.005)
    one = found(520.0, 75.0, measured_curves(), known=True)
    assert one.luminance == pytest.approx(1.0, abs=0.004)
    assert one.scale.scotopic_ratio.value == pytest.approx(one.scotopic_ratio, rel=1e-3)
    assert one.scale.doubt is None
    assert one.scale.card_doubt(one.card, 0.003) is None
    tinted = one.card * np.array([1.0, 1.0, 1.6])
    doubt = one.scale.card_doubt(tinted, 0.003)
    assert doubt is not None
    assert doubt.values["ratios"][2] > 1.4 * doubt.values["ratios"][1]


def test_without_an_emission_green_is_told_well_and_blue_is_not() -> None:
    green = found(520.0, 75.0, measured_curves(), known=False)
    assert abs(green.pull) < 2
    assert green.scale.relative_sigma < 0.06
    assert green.scale.doubt is None
    blue = found(470.0, 60.0, measured_curves(), known=False)
    assert abs(blue.pull) < 3
    assert blue.scale.doubt is not None
    assert blue.scale.doubt.code == "luminance-by-channels"


def test_an_emission_of_another_colour_is_noticed() -> None:
    one = found(590.0, 60.0, measured_curves(), known=True)
    assert one.scale.doubt is None
    ratio = np.array([0.05, 0.4, 1.0])
    emission = Emission(Spectrum("band", NM, band(NM, 590.0, 60.0)), "a file", 0.02)
    wrong = colour_scale(
        ratio,
        NOISE * ratio,
        camera_curves(rig()),
        card_radiance(rig()),
        bare_lamp_spectrum(rig()),
        card_reflectance(rig()),
        emission,
    )
    assert wrong.doubt is not None
    assert wrong.doubt.values == {"emission": "a file"}


@pytest.mark.campaign
@pytest.mark.parametrize("known", [True, False])
def test_errors_are_as_large_as_their_sigma(known: bool) -> None:
    pulls = []
    for seed in range(120):
        rng = np.random.default_rng([seed, 5])
        curves = bent_curves(np.random.default_rng([seed, 6]))
        middle_nm, fwhm_nm = rng.uniform(440, 620), rng.uniform(50, 110)
        one = found(middle_nm, fwhm_nm, curves, known=known, seed=seed)
        pulls.append(one.pull)
    assert_sigma_is_right(pulls)
