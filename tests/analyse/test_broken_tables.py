"""Tables that break what a fit assumes: the σ that follow, and that the result says so.

More cases and seeds: `python -m tests.acceptance.coverage_table_sigma --broken`.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.analyse import TableFitOptions, fit_table
from labrig.fit import DecayFit, fit_decay
from labrig.foundation.errors import FitError
from labrig.process import report_table
from tests.acceptance.coverage_table_sigma import (
    SINGLE,
    broken_pulls,
    ceiling,
    drift,
    root_of_counts,
    scaled,
)
from tests.warned import of_code


def fitted(folder: Path, *columns: np.ndarray, **options: object) -> DecayFit:
    """Fit a table of times, values and maybe σ."""
    table = folder / "table.csv"
    names = ["t_s", "value", "value_sigma"][: len(columns)]
    np.savetxt(table, np.transpose(columns), "%.9g", ",", header=",".join(names), comments="")
    return fit_table(table, TableFitOptions(**options))[0].fit  # type: ignore[arg-type]


@pytest.mark.campaign
def test_noise_that_correlates_is_in_sigma_and_named() -> None:
    pulls, said = broken_pulls(drift(SINGLE, 60, 0.8, given=False), range(8))
    # Without it the rms is 2.7.
    assert np.sqrt(np.mean(pulls**2)) < 1.9
    assert said >= 0.7


@pytest.mark.campaign
def test_counts_with_the_root_of_their_number_are_not_biased() -> None:
    """The mean pull was 1.8 and more."""
    pulls, said = broken_pulls(root_of_counts(100, 1), range(7))
    # The standard error of the mean is 0.4.
    assert abs(np.mean(pulls)) < 1.1
    assert said == 1


@pytest.mark.parametrize("factor", [0.3, 2])
def test_sigma_that_is_wrong_by_a_factor_is_named(factor: float) -> None:
    pulls, said = broken_pulls(scaled(factor, "constant"), range(4))
    assert said == 1
    if factor < 1:
        # Eight pulls: a σ left as given makes it 3.
        assert 0.4 < np.sqrt(np.mean(pulls**2)) < 1.7


def test_values_at_a_ceiling_are_left_out_and_shown(tmp_path: Path) -> None:
    pulls, said = broken_pulls(ceiling(0.8, SINGLE), range(4))
    assert abs(np.mean(pulls)) < 1.6
    assert said == 1
    t_s = np.linspace(0.5, 150, 60)
    signal = np.random.default_rng(3).poisson(1e4 * np.exp(-0.03 * t_s))
    table = tmp_path / "table.csv"
    rows = np.transpose([t_s, np.minimum(signal, 8000)])
    np.savetxt(table, rows, delimiter=",", header="t_s,value", comments="")
    options = TableFitOptions(states=1)
    (result,) = fit_table(table, options)
    assert result.series.flag[:3] == ("clipped",) * 3
    assert result.series.flag[3:] == ("",) * 57
    report = report_table(table, [result], options, tmp_path / "out").report
    assert "detector-clipped" in report.read_text(encoding="utf-8")


def test_a_first_value_that_is_too_low_is_named_and_kept(tmp_path: Path) -> None:
    t_s = np.linspace(0.5, 150, 60)
    values = np.exp(-0.03 * t_s) + 0.003 * np.random.default_rng(1).normal(size=60)
    values[0] = 0.94
    fit = fitted(tmp_path, t_s, values, states=1, origin="-10")
    warned = of_code(fit.warnings, "first-values-low").values
    assert (warned["values"], warned["until_s"]) == (1, 0.5)
    assert warned["next_time"].startswith("3.03")
    assert len(fit.residuals) == 60


@pytest.mark.parametrize("seed", range(2))
def test_a_clean_table_is_not_complained_about(tmp_path: Path, seed: int) -> None:
    t_s = np.linspace(0.5, 200, 60)
    signal = 1000 * np.exp(-0.1 * t_s) + 600 * np.exp(-0.015 * t_s)
    sigma = np.full_like(t_s, 3.0)
    values = signal + sigma * np.random.default_rng([7, seed]).normal(size=60)
    fit = fitted(tmp_path, t_s, values, sigma)
    assert (fit.warnings, fit.sigma_factor, fit.sigma_origin) == ((), 1.0, "the table")


@settings(max_examples=5, deadline=None)
@given(
    count=st.floats(0.01, 100.0),
    constant=st.sampled_from([0.0, 1.0]),
    decimals=st.integers(3, 7),
    seed=st.integers(0, 1000),
)
def test_how_sigma_follows_from_the_values_is_found(
    tmp_path_factory: pytest.TempPathFactory,
    count: float,
    constant: float,
    decimals: int,
    seed: int,
) -> None:
    counts = 1 + np.random.default_rng(seed).poisson(5000 * np.exp(-0.03 * np.arange(0, 120, 3.0)))
    sigma = count * np.sqrt(counts + constant)
    columns = (np.arange(0, 120, 3.0), count * counts, sigma.round(decimals))
    fit = fitted(tmp_path_factory.mktemp("counts"), *columns, states=1, flicker="0")
    assert "of the fitted curve" in fit.sigma_origin
    expected = count * np.sqrt(5000 * np.exp(-0.03 * columns[0]) + constant)
    bright = expected > 7 * count
    assert fit.sigma[bright, 0] / fit.sigma_factor == pytest.approx(expected[bright], rel=0.06)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10000), st.floats(2.5, 10.0))
def test_the_factor_of_sigma_is_that_of_the_scatter(seed: int, factor: float) -> None:
    t_s = np.linspace(0.5, 200, 80)
    values = np.exp(-0.03 * t_s) + 0.01 * np.random.default_rng(seed).normal(size=80)
    fit = fit_decay(t_s, values, 0.01 / factor, n_states=1)
    # The relative standard error of a standard deviation of 80 values is 8 %.
    assert fit.sigma_factor == pytest.approx(factor, rel=0.35)
    unscaled = fit_decay(t_s, values, 0.01 * fit.sigma_factor / factor, n_states=1)
    assert unscaled.states[0].k_r_per_s == pytest.approx(fit.states[0].k_r_per_s, rel=1e-6)
    assert json.loads(fit.to_json())["sigma_factor"] == fit.sigma_factor


@pytest.mark.parametrize(("counts", "seed"), [(20.0, 3), (2000.0, 23)])
def test_a_maximum_by_noise_is_no_rise(tmp_path: Path, counts: float, seed: int) -> None:
    # A slow decay of counted photons: its largest value is not its first one.
    t_s = np.arange(120) * 0.4
    values = np.random.default_rng([41, seed]).poisson(counts * np.exp(-0.02 * t_s))
    assert values.argmax() > 3
    fit = fitted(tmp_path, t_s, values.astype(float), states=1, weights="counts", flicker="0")
    assert abs(fit.rates[0].value - 0.02) < 4 * fit.rates[0].sigma


@pytest.mark.parametrize("counts", [100.0, 10_000.0])
def test_a_rising_edge_of_an_instrument_is_refused(tmp_path: Path, counts: float) -> None:
    number = np.arange(300)
    edge = np.exp(-(((number - 12) / 4) ** 2))
    signal = np.convolve(edge / edge.sum(), np.exp(-0.02 * number))[:300]
    values = np.random.default_rng(41).poisson(counts * signal + 2).astype(float)
    with pytest.raises(FitError, match=r"rises until (?:1[2-9]|2[0-9]|3[0-4])"):
        fitted(tmp_path, number * 1.0, values, weights="counts", flicker="0")
