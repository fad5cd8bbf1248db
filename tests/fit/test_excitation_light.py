"""Errors of the light whose size nobody told, and a layer in which light is absorbed."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.material import Material, read_material
from labrig.results import ChargingSeries, FittedExcitation
from labrig.sim.lamp import WAVELENGTH_NM
from tests.fit.charged_samples import Bench, lvf_windows
from tests.fit.layers import Layer
from tests.warned import of_code

#: Places at which three bands excite blue paint.
WINDOWS = lvf_windows(np.linspace(405, 560, 24))
#: Places of a whole filter.
WHOLE = lvf_windows(np.linspace(405, 695, 31))
#: What the fit is told of the scatter of places and of the lamp.
SITES, LAMP = 0.03, 0.005
FREE = RelativeSigmas(flicker=0.005, lamp=LAMP, largest_factor=3.0)


def excited_by_all() -> Material:
    """A paint that all bands excite."""
    blue = read_material("blue-paint")
    k_e = (0.08, 0.06, 0.04, 0.03, 0.02, 0.02, 0.02, 0.02)
    state = blue.states[0].model_copy(update={"k_e_per_s": k_e})
    return blue.model_copy(update={"states": (state,)})


def charged(bench: Bench, scatter: float, lamp: float) -> ChargingSeries:
    """Charges of places whose light is off by `scatter`, by a lamp that is off by `lamp`."""
    off = np.exp(scatter * bench.random.normal(size=len(WHOLE)))
    series = bench.series(
        "through the filter", WHOLE * off[:, None], (8, 32, 128, 256), shots=3, every_s=25.0
    )
    charges = tuple(
        replace(one, brightness=one.brightness * float(np.exp(lamp * bench.random.normal())))
        for one in series.charges
    )
    return replace(
        series,
        charges=charges,
        irradiance=bench.irradiances(WHOLE),
        values=series.values[..., 1:],
        sigma=series.sigma[..., 1:],
        site_modes=SITES * np.eye(len(WHOLE))[:, :, None] * np.ones(8),
        mode_kind=np.zeros(len(WHOLE), dtype=np.intp),
    )


@pytest.mark.campaign
def test_sigma_of_rates_is_their_errors_whatever_the_lights_errors_are() -> None:
    pulls, sizes = [], []
    for scatter, lamp in ((0.01, 0.003), (0.04, 0.01)):
        for seed in range(10):
            bench = Bench(excited_by_all(), seed=seed + round(1e4 * scatter))
            fit = fit_excitation([charged(bench, scatter, lamp)], [0.03], [1.0], FREE)
            (state,), (truth,) = fit.states, bench.material.states
            off = state.k_e_per_s - np.array(truth.k_e_per_s)
            # Independent of each other, as the pulls of bands are not.
            pulls.append(np.linalg.solve(np.linalg.cholesky(fit.covariance[2:, 2:]), off))
            sizes.append(SITES * fit.site_sizes[0])
    rms = float(np.sqrt(np.mean(np.square(pulls))))
    assert 0.9 < rms < 1.25
    assert np.mean(sizes[:10]) == pytest.approx(0.01, rel=0.35)
    assert np.mean(sizes[10:]) == pytest.approx(0.04, rel=0.35)


def through_and_bare(bench: Bench) -> FittedExcitation:
    windows = WINDOWS[::2]
    through = bench.series("through the filter", windows, (8, 32, 128, 512), shots=6, every_s=15.0)
    bare = bench.series("bare", np.ones((1, len(WAVELENGTH_NM))), (3, 10, 60, 900), shots=6)
    return fit_excitation([through, bare], [0.03], [1.0], RelativeSigmas(0.002, 0.002))


def test_a_thick_layer_is_told_from_a_thin_one() -> None:
    tests = through_and_bare(
        Bench(read_material("blue-paint"), flicker=0.002, photons=200.0, seed=3)
    ).by_band
    assert tests is not None
    assert not tests.is_thick
    assert not tests.amplitude.differs
    assert not tests.rate.differs
    fit = through_and_bare(Layer(read_material("blue-paint"), flicker=0.002, photons=200.0, seed=4))
    assert fit.by_band is not None
    assert fit.by_band.is_thick
    assert fit.by_band.optical_density == pytest.approx(1.0, abs=0.35)
    loss = fit.states[0].amplitude / Bench(read_material("blue-paint")).amplitudes()[0] - 1
    assert loss < -0.05
    stated = fit.by_band.charged_glow_by_variance * fit.by_band.light_variance.value
    assert loss == pytest.approx(stated, rel=0.5)
    optical_density = of_code(fit.warnings, "layer-thick").values["optical_density"]
    assert optical_density == fit.by_band.optical_density


def test_a_decay_and_a_hue_that_depend_on_the_exciting_band_are_told() -> None:
    bench = Bench(read_material("blue-paint"), seed=5)
    series = bench.series("through the filter", WINDOWS[::2], (8, 32, 128), shots=6, every_s=15.0)
    place = np.arange(len(WINDOWS[::2]))[:, None]
    begin_s = np.concatenate([one.start_s - one.off_s for one in series.charges])
    faster = np.where(place > 7, np.exp(-0.01 * begin_s[:, None, None]), 1.0)
    hue = np.where(place > 4, np.array([1.0, 1.0, 1.4]), 1.0)
    sigmas = RelativeSigmas(0.005, 0.002)
    for values, verdict in ((faster, (True, False)), (hue, (False, True)), (1.0, (False, False))):
        changed = replace(series, values=series.values * values)
        tests = fit_excitation([changed], [0.03], [1.0], sigmas).by_band
        assert tests is not None
        assert tests.hue is not None
        assert (tests.rate.differs, tests.hue.differs) == verdict
