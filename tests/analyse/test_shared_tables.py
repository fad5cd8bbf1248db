"""Several tables have the same rates, each its own amplitudes, offset and unit of time."""

import json
from pathlib import Path

import numpy as np
import pytest

from labrig.analyse import TableFitOptions, fit_shared_tables
from labrig.fit import DecayTable, fit_shared_rates
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError, UsageError
from labrig.process import report_shared_decay
from labrig.results import OneSided
from tests.warned import codes

T_S = np.linspace(0, 60, 50)
RATES = (0.3, 0.04)
AMPLITUDES, OFFSETS, NOISE = ((100.0, 20.0), (30.0, 80.0)), (5.0, -2.0), (1.0, 0.5)
#: Heads of the columns of times, seconds in their units, and zeros of the clocks.
CLOCKS = (("t_s", 1.0, 0.0), ("time / min", 60.0, 1.2e7))


def decay(number: int, rng: np.random.Generator) -> FloatArray:
    fast, slow = AMPLITUDES[number]
    light = fast * np.exp(-RATES[0] * T_S) + slow * np.exp(-RATES[1] * T_S)
    return np.asarray(light + OFFSETS[number] + NOISE[number] * rng.standard_normal(len(T_S)))


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    rng, written = np.random.default_rng(17), []
    for number, (head, unit_s, zero_s) in enumerate(CLOCKS):
        path = tmp_path / f"{'AB'[number]}.csv"
        rows = [
            f"{(zero_s + t_s) / unit_s:.12f},{value!r},{NOISE[number]}"
            for t_s, value in zip(T_S, decay(number, rng).tolist(), strict=True)
        ]
        path.write_text("\n".join([f"{head},y,y_sigma", *rows]), encoding="utf-8")
        written.append(path)
    return written


@pytest.mark.parametrize("weights", ["given", "equal"])
def test_rates_are_shared_and_the_rest_is_each_table_s_own(
    paths: list[Path], tmp_path: Path, weights: str
) -> None:
    options = TableFitOptions(offset="free", weights=weights)
    shared, tables = fit_shared_tables(paths, options)
    assert len(shared.rates) == 2
    for rate, true in zip(shared.rates, RATES, strict=True):
        assert abs(rate.value - true) < 4 * rate.sigma
    for number, (table, alone) in enumerate(zip(shared.tables, tables, strict=True)):
        for state, true in zip(table.states, AMPLITUDES[number], strict=True):
            assert abs(state.amplitude - true) < 4 * state.amplitude_sigma
        assert abs(table.offset - OFFSETS[number]) < 4 * table.offset_sigma
        # What tables share, they know better together.
        assert shared.rates[-1].sigma < alone.fit.rates[-1].sigma
        if weights == "equal":
            assert table.residual_sigma == pytest.approx(NOISE[number], rel=0.4)
    assert [table.reference.is_lamp_off for table in shared.tables] == [True, False]
    assert shared.tables[1].reference.clock_s == pytest.approx(1.2e7)
    report = report_shared_decay(
        paths, shared, [table.series for table in tables], "labrig", tmp_path / "out"
    )
    content = json.loads((report.parent / "fit.json").read_text(encoding="utf-8"))
    assert content["n_states"] == 2
    assert len(content["covariance"]) == len(content["covariance_parameters"]) == 8
    assert report.read_text(encoding="utf-8").count("<figure") == 1


def test_different_rates_are_told() -> None:
    rng, zero = np.random.default_rng(1), np.zeros(50)
    tables = [
        DecayTable(name, T_S, zero, 100 * np.exp(-k * T_S) + rng.standard_normal(50), zero + 1)
        for name, k in (("A", 0.10), ("B", 0.13))
    ]
    assert "rates-not-shared" in codes(fit_shared_rates(tables, 1).warnings)


def test_what_cannot_share_is_refused(paths: list[Path]) -> None:
    with pytest.raises(UsageError, match="two tables or more"):
        fit_shared_tables(paths[:1], TableFitOptions())
    with pytest.raises(UsageError, match="--law"):
        fit_shared_tables(paths, TableFitOptions(law="stretched"))
    zero = np.zeros(50)
    dark = DecayTable("dark", T_S, zero, zero - 1.0, zero + 1)
    with pytest.raises(FitError, match="dark: expected a signal that decays"):
        fit_shared_rates([dark, dark])


def test_a_table_without_a_state_has_a_limit_of_its_amplitude() -> None:
    t_s = np.linspace(0.0, 60.0, 120)
    fast, slow = np.exp(-0.3 * t_s), np.exp(-0.04 * t_s)
    covered, held = [], 0
    for seed in range(7):
        rng = np.random.default_rng([seed, 5])
        tables = [
            DecayTable(
                *(name, t_s, np.zeros_like(t_s)),
                *(light + 0.5 * rng.standard_normal(len(t_s)), np.full(len(t_s), 0.5)),
            )
            for name, light in (("both", 100 * fast + 50 * slow), ("slow", 60 * slow))
        ]
        (amplitude, _) = fit_shared_rates(tables, 2).tables[1].amplitudes
        if isinstance(amplitude, OneSided):
            held += 1
            covered.append(amplitude.limit > 0)
            assert str(amplitude).startswith("<")
        else:
            covered.append(abs(amplitude.value) < 3 * amplitude.sigma)
    assert held >= 2
    assert all(covered)
