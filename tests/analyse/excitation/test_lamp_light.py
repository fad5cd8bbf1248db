"""What is said of the light behind a filter, and when a lamp was cold."""

import numpy as np
import pytest

from labrig.protocols.excitation.analysis.charge_intervals import ChargeInterval, with_warmth
from labrig.protocols.excitation.analysis.lamp_light import (
    SITES,
    WAVELENGTHS,
    across_sites,
    band_sigma,
    mode_kinds,
    site_modes,
    weighted_over_mean,
)
from tests.analyse.excitation.bench import true_irradiance


def test_across_a_place_the_light_runs_as_along_the_filter() -> None:
    irradiance = true_irradiance()
    across = across_sites(irradiance)
    through = np.array(irradiance.through)
    np.testing.assert_allclose(across.mean(axis=0), 1.0)
    # Between Gauss's two places in a slice the light changes as from slice to slice.
    change = np.gradient(np.log(through), axis=0) / np.sqrt(3)
    found = np.log(across[1] / across[0])
    assert np.corrcoef(found.ravel(), change.ravel())[0, 1] > 0.95
    assert np.median(np.abs(found[np.abs(change) > 0.1])) > 0.1


def test_what_is_reported_of_a_place_is_what_its_modes_add_up_to() -> None:
    irradiance = true_irradiance()
    through = np.array(irradiance.through)
    leaks = np.where(through < 0.01 * through.max(axis=0), 0.5, 0.02)
    sure = irradiance.model_copy(update={"through_sigma": tuple(map(tuple, 0.02 * through))})
    unsure = irradiance.model_copy(update={"through_sigma": tuple(map(tuple, leaks * through))})
    variance = [(site_modes(one) ** 2).sum(axis=0) for one in (sure, unsure)]
    far = leaks == 0.5
    assert np.sqrt(np.median((variance[1] - variance[0])[far])) == pytest.approx(0.5, rel=0.1)
    assert band_sigma(sure) == pytest.approx(np.full(8, 0.003))


def test_the_modes_of_unknown_size_move_light_along_the_filter_or_on_single_places() -> None:
    irradiance = true_irradiance()
    modes, kind = site_modes(irradiance), mode_kinds(irradiance)
    assert len(modes) == len(kind)
    through = np.array(irradiance.through)
    of_wavelengths = np.abs(modes[kind == WAVELENGTHS]).sum(axis=0)
    steep = np.abs(np.gradient(np.log(through), axis=0))
    assert np.corrcoef(of_wavelengths.ravel(), steep.ravel())[0, 1] > 0.95
    lit = np.abs(modes[kind == SITES]) > 0
    assert (lit.any(axis=2).sum(axis=1) == 1).all()


def test_a_lamp_is_warm_after_a_long_charge_and_cools_in_the_dark() -> None:
    times_s = {"a": (0.0, 10.0), "b": (20.0, 2000.0), "c": (2010.0, 2020.0), "d": (4000.0, 4010.0)}
    intervals = [ChargeInterval(unit, *both) for unit, both in times_s.items()]
    cold_deficit = [one.cold_deficit for one in with_warmth(intervals, 150.0)]
    assert cold_deficit[0] == pytest.approx(1 - 10 / 150 / 2, abs=0.002)
    assert cold_deficit[2] < 0.1
    assert cold_deficit[3] > 0.95


@pytest.mark.parametrize("k_r_per_s", [1e-6, 1 / 150, 0.03, 1.0])
def test_of_a_warming_lamp_a_sample_remembers_the_end_of_the_charge(k_r_per_s: float) -> None:
    t_s = np.linspace(0.0, 240.0, 200_001)
    lacking, memory = np.exp(-t_s / 150.0), np.exp(-k_r_per_s * (240.0 - t_s))
    expected = np.average(lacking, weights=memory) / lacking.mean()
    assert weighted_over_mean(240.0, 150.0, k_r_per_s) == pytest.approx(expected, rel=1e-4)
