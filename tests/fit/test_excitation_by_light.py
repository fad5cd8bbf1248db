"""Excitation rates of a sample that one selected light after another has charged."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.fit.excitation.levels import levels
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.results import ChargingSeries
from tests.fit.charged_samples import BARE, Bench, lvf_windows, two_states

#: Band-pass filters of about the width of the bands.
WINDOWS = lvf_windows(np.array([420.0, 455.0, 495.0, 530.0, 570.0, 605.0, 645.0, 680.0]), 30.0)
LIGHTS = [light for light in range(8) for _ in range(2)]


def one_after_another(bench: Bench, wait_s: float = 200.0) -> ChargingSeries:
    return bench.series("by lights", WINDOWS, [30.0, 240.0] * 8, wait_s, shots=8, lights=LIGHTS)


def test_rates_of_bands_that_were_excited_one_after_another() -> None:
    """The slow state is far from dark when the next light begins."""
    bench = Bench(two_states(), seed=31)
    bare = bench.series("bare lamp", BARE, [10.0, 60.0, 1800.0], shots=20, every_s=6.0)
    rates = 1.1 * np.array([state.k_r_per_s for state in bench.material.states])
    uncertain = RelativeSigmas(bench.flicker, 0.01)
    found = fit_excitation([one_after_another(bench), bare], rates, bench.amplitudes(), uncertain)
    assert found.warnings == ()
    assert 0.9 < found.reduced_chi2 < 1.1
    for state, truth in zip(found.states, bench.material.states, strict=True):
        k_e = np.array(truth.k_e_per_s)
        assert abs(state.k_r_per_s - truth.k_r_per_s) < 3 * state.k_r_per_s_sigma
        assert (np.abs(state.k_e_per_s - k_e) < 3 * state.k_e_per_s_sigma + 1e-5).all()
        strong = k_e >= 0.003
        assert state.k_e_per_s[strong] == pytest.approx(k_e[strong], rel=0.1)
    assert found.by_band is not None
    assert len(found.by_band.bands) > 4
    assert not found.by_band.amplitude.differs


@pytest.mark.parametrize("order", [None, np.array([1.0, 1.0]), np.array([1.4, 2.3])])
def test_derivatives_of_levels_by_lights(order: FloatArray | None) -> None:
    series = one_after_another(Bench(two_states()), 60.0)
    k_r, k_e = np.array([0.08, 0.015]), np.linspace(0.001, 0.1, 16).reshape(2, 8)
    level, step = levels(series, k_r, k_e, order), 1e-6
    for state in range(2):
        for band in (0, 3):
            more, less = k_e.copy(), k_e.copy()
            more[state, band] *= 1 + step
            less[state, band] *= 1 - step
            difference = levels(series, k_r, more, order).value
            difference = difference - levels(series, k_r, less, order).value
            slope = difference[..., state] / (2 * step * k_e[state, band])
            assert level.by_k_e[..., state, band] == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_both_ways_of_stepping_agree() -> None:
    series = one_after_another(Bench(two_states()), 60.0)
    rates = np.array([0.08, 0.015]), np.linspace(0.001, 0.1, 16).reshape(2, 8)
    affine, general = (levels(series, *rates, order) for order in (None, np.ones(2)))
    assert general.value == pytest.approx(affine.value, rel=1e-4)


def test_errors_of_a_light_and_of_the_lamp_last_until_later_charges() -> None:
    modes = np.zeros((8, 8, 8))
    modes[np.arange(8), np.arange(8)] = 0.02
    series = replace(
        one_after_another(Bench(two_states()), 60.0), site_modes=modes, mode_kind=np.full(8, -1)
    )
    problem = ExcitationProblem([series], 2, 1, RelativeSigmas(lamp=0.01, cold_deficit=0.02))
    theta = problem.parameters.as_stated(
        np.array([0.08, 0.015]), np.array([2e3, 1e3]), np.full((2, 8), 0.02), np.ones(3), np.ones(2)
    )
    columns, step = problem.parameters.columns, 1e-4
    _, jacobian = problem.residuals(theta)
    for place in (columns.off.start + 3, columns.brightness.start + 5):
        more, less = theta.copy(), theta.copy()
        more[place] += step
        less[place] -= step
        slope = (problem.residuals(more)[0] - problem.residuals(less)[0]) / (2 * step)
        assert jacobian[:, place] == pytest.approx(slope, rel=1e-4, abs=1e-6 * np.abs(slope).max())
    row = series.row_of_shots()[:, 0]
    stated = jacobian[: series.values.size, columns.off.start + 3].reshape(series.values.shape)
    assert np.abs(stated[row > 3]).max() > 0.01 * np.abs(stated).max()
    assert np.abs(stated[row < 3]).max() == 0


def test_a_light_that_is_none_is_refused() -> None:
    series = one_after_another(Bench(two_states()))
    charges = (replace(series.charges[0], light=8), *series.charges[1:])
    with pytest.raises(FitError, match="expected one of 8 lights at every charge"):
        replace(series, charges=charges).checked()
