"""A decay fits the same wherever its clock has its zero."""

import math
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

import labrig
from labrig.analyse import TableFitOptions, fit_table
from labrig.foundation.errors import UsageError
from labrig.results import FittedDecay

STEP, N = Decimal("1.5"), 40
T_S = np.arange(N) * float(STEP)
VALUES = (
    700 * np.exp(-0.3 * T_S)
    + 300 * np.exp(-0.05 * T_S)
    + 4 * np.random.default_rng(41).standard_normal(N)
)
ORIGINS = ("-1000", "100000.3", "1760000000.123456789", "-4e9")


def table(path: Path, origin: str, unit_s: Decimal = Decimal(1), head: str = "t_s") -> Path:
    rows = [
        f"{(Decimal(origin) + number * STEP) / unit_s:f},{value!r},4"
        for number, value in enumerate(VALUES.tolist())
    ]
    path.write_text("\n".join([f"{head},y,y_sigma", *rows]), encoding="utf-8")
    return path


def numbers(fit: FittedDecay) -> Sequence[tuple[float, float]]:
    return [
        pair
        for state in fit.states
        for pair in (
            (state.k_r_per_s, state.k_r_per_s_sigma),
            (state.amplitude, state.amplitude_sigma),
        )
    ]


def assert_same(fit: FittedDecay, expected: FittedDecay) -> None:
    for (value, sigma), (right, right_sigma) in zip(numbers(fit), numbers(expected), strict=True):
        assert abs(value - right) < 1e-6 * right_sigma
        assert sigma == pytest.approx(right_sigma, rel=1e-6)
    assert fit.warnings == expected.warnings == ()


@pytest.fixture(scope="module")
def from_zero(tmp_path_factory: pytest.TempPathFactory) -> FittedDecay:
    fit = fit_table(table(tmp_path_factory.mktemp("zero") / "t.csv", "0"))[0].fit
    assert fit.reference.is_lamp_off
    return fit


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("origin", ORIGINS)
def test_a_table_fits_the_same_at_any_origin(
    tmp_path: Path, from_zero: FittedDecay, origin: str
) -> None:
    (fitted,) = fit_table(table(tmp_path / "t.csv", origin))
    fit = fitted.fit
    assert_same(fit, from_zero)
    assert fit.reference.clock_s == float(origin)
    assert "amplitudes are those at the first row" in str(fit)
    # The fit counts as its series does.
    np.testing.assert_allclose(
        fit.predict(fitted.series.t_s), from_zero.predict(T_S), rtol=1e-9, atol=1e-6
    )


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("origin_s", [9000.0, -4e9])
def test_floats_with_a_large_origin_fit_the_same(from_zero: FittedDecay, origin_s: float) -> None:
    fit = labrig.fit_decay(T_S + origin_s, VALUES, 4.0, flicker=None)
    assert_same(fit, from_zero)
    assert fit.reference.t_s == origin_s
    np.testing.assert_allclose(fit.predict(T_S + origin_s), from_zero.predict(T_S), rtol=1e-9)


def test_nanoseconds_are_kept_on_the_clock_of_days(tmp_path: Path, from_zero: FittedDecay) -> None:
    # 0.75 ns steps at 86400.000000001 s: less than what a float tells there.
    nano = Decimal("1e-9")
    rows = [
        f"{Decimal('86400.000000001') + nano * number * STEP:f},{value!r},4"
        for number, value in enumerate(VALUES.tolist())
    ]
    path = tmp_path / "ns.csv"
    path.write_text("\n".join(["t_s,y,y_sigma", *rows]), encoding="utf-8")
    (fitted,) = fit_table(path)
    rates = [state.k_r_per_s * 1e-9 for state in fitted.fit.states]
    expected = [state.k_r_per_s for state in from_zero.states]
    np.testing.assert_allclose(rates, expected, rtol=1e-9)
    (series,) = labrig.read_series(path)
    assert labrig.fit_series(series).reference.clock_s == pytest.approx(86400.0)


def test_amplitudes_at_lamp_off_where_the_clock_tells_it(tmp_path: Path) -> None:
    path = table(tmp_path / "t.csv", "1760000000")
    options = TableFitOptions(states=2, origin="1759999998")
    fit = fit_table(path, options)[0].fit
    assert fit.reference.is_lamp_off
    fast, slow = fit.states
    assert abs(fast.amplitude - 700 * math.exp(0.6)) < 4 * fast.amplitude_sigma
    assert abs(slow.amplitude - 300 * math.exp(0.1)) < 4 * slow.amplitude_sigma
    late = labrig.fit_decay(T_S + 40, VALUES, 4.0, n_states=2)
    assert not late.reference.is_lamp_off
    state = late.states_at_lamp_off[1]
    assert abs(state.amplitude - 300 * math.exp(2)) < 4 * state.amplitude_sigma


@pytest.mark.parametrize(("start", "origin"), [("5", "2"), ("300 s", "0,0333333333333 h")])
def test_times_are_in_the_unit_of_the_table_or_with_one(
    tmp_path: Path, start: str, origin: str
) -> None:
    path = tmp_path / "min.csv"
    rows = [f"{2 + number * STEP:f},{v!r},4" for number, v in enumerate(VALUES.tolist())]
    path.write_text("\n".join(["time / min,y,y_sigma", *rows]), encoding="utf-8")
    (fitted,) = fit_table(path, TableFitOptions(states=2, start=start, origin=origin))
    assert fitted.series.t_s[0] == pytest.approx(180.0)
    assert len(fitted.series.t_s) == N - 2


@pytest.mark.parametrize("text", ["5 parsec", "", "nan"])
def test_a_time_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(UsageError, match="--from: expected a time such as '330'"):
        fit_table(table(tmp_path / "t.csv", "0"), TableFitOptions(start=text))
