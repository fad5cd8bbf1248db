"""What all places of a photograph have in common, and what each place has in all photographs."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.material import read_material
from labrig.protocols.excitation.analysis import common_flicker
from labrig.protocols.excitation.analysis.charging_series import evened, evenness
from tests.fit.charged_samples import BARE, LVF, Bench
from tests.results.made_excitation import excitation_result


@pytest.mark.parametrize("flicker", [pytest.param(0.004, marks=pytest.mark.campaign), 0.012])
def test_flicker_is_that_of_all_photographs(flicker: float) -> None:
    """Of 3 × 175 photographs; those of a dozen would scatter by a fifth."""
    found = []
    for seed in (5, 6, 7):
        sample = Bench(read_material("blue-paint"), flicker=flicker, photons=2000.0, seed=seed)
        through = sample.series("LVF", LVF, (8.0, 16.0, 64.0, 128.0, 256.0), shots=30, every_s=3.0)
        bare = sample.series("bare lamp", BARE, (900.0,), shots=25, every_s=4.0)
        fit = fit_excitation([bare, through], [0.03], [1.0], RelativeSigmas(0.007, 0.01))
        found.append(common_flicker(fit, [bare, through], (1e-3, 1e-3, 1e-3)))
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(flicker, rel=0.12)


def test_evenness_is_that_of_places_in_the_same_light() -> None:
    rng = np.random.default_rng(6)
    even = 1 + 0.03 * np.cos(np.linspace(0.0, 3.0, 6))
    glow = np.array([100.0, 400.0, 2000.0])[:, None]
    values = (glow * even)[..., None] * [0.3, 1.0, 0.7]
    sigma = 1e-3 * values
    values = values + sigma * rng.normal(size=values.shape)
    assert evenness(values, sigma) == pytest.approx(even / even.mean(), rel=3e-3)


def test_values_are_divided_by_the_evenness_that_a_fit_has_found() -> None:
    patch = next(iter(excitation_result().patches.values()))
    charging, fit = patch.charging, replace(patch.fit, evenness=np.array([1.02, 1.0, 1 / 1.02]))
    found = evened(charging, fit)
    assert found.evenness == pytest.approx(charging.evenness * fit.evenness)
    for after, before in ((found.through, charging.through), (found.direct, charging.direct)):
        assert after.values * fit.evenness[:, None] == pytest.approx(before.values, nan_ok=True)
        assert after.sigma * fit.evenness[:, None] == pytest.approx(before.sigma)
