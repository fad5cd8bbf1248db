"""Thickness of a layer, and rates that are fitted as those of a surface."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from labrig.fit.excitation import RelativeSigmas, fit_excitation, layer_effect
from labrig.foundation.arrays import FloatArray
from labrig.material import read_material
from labrig.results import DensityBasis, FittedExcitation, LayerEffect
from labrig.sim.lamp import WAVELENGTH_NM, Lamp
from labrig.sim.phosphor import phosphor
from tests.fit.charged_samples import Bench, lvf_windows

WINDOWS = lvf_windows(np.linspace(405, 560, 8))
SIGMAS = RelativeSigmas(0.002, 0.002)


@dataclass
class Deep(Bench):
    """A layer that absorbs light as it excites, or light of every wavelength alike."""

    density: float = 1.0
    is_grey: bool = False

    def _glow(self, windows: FloatArray, lamp: Lamp, charges: object) -> FloatArray:
        absorbed = phosphor([self.material], [None], self.irradiance).excitation.sum(axis=0)
        absorbed = np.ones_like(absorbed) if self.is_grey else absorbed / absorbed.max()
        depth = (np.arange(16) + 0.5) / 16
        passed = 10.0 ** (-self.density * np.outer(depth, absorbed))
        each = (windows[:, None, :] * passed).reshape(-1, windows.shape[1])
        glow = super()._glow(each, lamp, charges)  # type: ignore[arg-type]
        mean: FloatArray = glow.reshape(len(glow), len(windows), -1).mean(axis=2)
        return mean


def measured(bench: Bench, largest: float = 2.0) -> tuple[FittedExcitation, LayerEffect]:
    through = bench.series("through the filter", WINDOWS, (8, 32, 128), shots=2, every_s=15.0)
    bare = bench.series("bare", np.ones((1, len(WAVELENGTH_NM))), (3, 10, 60, 900), shots=2)
    series = [through, bare]
    fit = fit_excitation(series, [0.03], [1.0], SIGMAS)
    limit = np.full(len(bench.material.bands_nm or ()) - 1, largest)
    return fit, layer_effect(series, fit, SIGMAS, limit, DensityBasis.PRIOR)


def bench(seed: int, **more: object) -> Deep:
    return Deep(read_material("blue-paint"), flicker=0.002, photons=50.0, seed=seed, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("is_grey", "density"), [(False, 1.0), pytest.param(True, 0.7, marks=pytest.mark.campaign)]
)
def test_the_range_of_a_layer_has_the_true_rates_and_the_fit_has_not(
    is_grey: bool, density: float
) -> None:
    sample = bench(3, density=density, is_grey=is_grey)
    fit, effect = measured(sample)
    truth = np.array(sample.material.states[0].k_e_per_s)
    strong = truth > 0.004
    k_e, sigma = fit.states[0].k_e_per_s[strong], fit.states[0].k_e_per_s_sigma[strong]
    assert (np.abs(truth[strong] - k_e) > 5 * sigma).all()
    least, largest = replace(fit, layer=effect).k_e_range(0)[:, strong]
    assert (least - 2 * sigma < truth[strong]).all()
    assert (truth[strong] < largest + 2 * sigma).all()
    low, high = effect.optical_density
    assert low <= density < high
    state = fit.states[0]
    whole = sample.amplitudes()[0] / sample.material.states[0].k_r_per_s
    ends = effect.reradiation_factor[:, 0] * state.amplitude / state.k_r_per_s
    assert 0.97 * ends[0] < whole < 1.03 * ends[1]


def test_a_layer_that_is_known_to_be_thin_has_a_small_range() -> None:
    fit, effect = measured(bench(5, density=0.04), largest=0.05)
    assert effect.optical_density[1] <= 0.05
    # A layer of optical density D has a mean light of (1 − 10^−D)/(D ln 10).
    assert effect.k_e_factor.max() == pytest.approx(0.05 * np.log(10) / (1 - 10**-0.05), rel=0.01)
    assert effect.k_e_factor.min() == pytest.approx(1.0, abs=0.01)
    assert np.isfinite(fit.reduced_chi2)


@pytest.mark.campaign
def test_charges_of_a_thin_sample_exclude_a_thick_one() -> None:
    _, effect = measured(bench(6, density=0.0))
    assert effect.optical_density[0] == 0.0
    assert effect.optical_density[1] < 1.2
    assert not effect.is_shown


def test_charges_near_saturation_show_a_layer() -> None:
    _, effect = measured(bench(7, density=1.0, irradiance=40.0))
    assert effect.is_shown
    low, high = effect.optical_density
    assert 0.3 < low < 1.0 < high < 1.9
