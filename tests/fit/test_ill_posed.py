"""Data from which no decay, or not the one asked for, can be had: an error or a warning."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import ResultWarning, as_warnings
from tests.conftest import Ended
from tests.fit import truths
from tests.warned import codes

Labrig = Callable[..., Ended]

T = truths.TIMES_S
NOISE = np.random.default_rng(3).normal(size=len(T))
DECAY = 100 * np.exp(-0.02 * T)


def with_frame(row: int, value: float) -> FloatArray:
    """A decay in which one frame was disturbed."""
    return np.where(np.arange(len(T)) == row, value, DECAY + 0.3 * NOISE)


@dataclass(frozen=True)
class Case:
    """A table, options of the fit, and a part of the error or the code of the warning."""

    name: str
    values: FloatArray
    sigma: float
    expected: str
    options: Sequence[str] = ()
    t_s: FloatArray = field(default_factory=T.copy)
    warning_values: Mapping[str, object] = field(default_factory=dict)

    def matches(self, warning: ResultWarning) -> bool:
        """Whether subject and values of a warning are those of the case, as far as it has them."""
        found = {"subject": warning.subject, **warning.values}
        return all(found.get(name) == value for name, value in self.warning_values.items())


REFUSED = [
    Case("all zeros", 0 * T, 1.0, "expected a positive signal"),
    Case("all below zero", -DECAY, 1.0, "expected a positive signal"),
    Case("noise", NOISE, 1.0, "was the sample charged"),
    Case("constant", 100 + NOISE, 1.0, "constant within its noise for 180 s"),
    Case("rising", 100 + T / 2 + NOISE, 1.0, "got one that rises"),
    Case("one point", DECAY[:1], 1.0, "times of two or more values", (), T[:1]),
    Case(
        "too few for what is asked",
        DECAY[:3],
        1.0,
        "values at 4 times or more for 2 state(s), got 3",
        ("--states", "2"),
        T[:3],
    ),
    Case("no points", DECAY[:0], 1.0, "got a header without rows", (), T[:0]),
    Case(
        "one moment", DECAY, 1.0, "expected values at several times, got all at 5 s", (), 0 * T + 5
    ),
    Case("NaN in time", DECAY, 1.0, "finite number for 't_s'", (), np.where(T > 60, np.nan, T)),
]
WARNED = [
    Case(
        "NaN",
        with_frame(5, np.nan),
        0.3,
        "row-without-value",
        warning_values={"subject": "line 7", "cell": "nan"},
    ),
    Case(
        "infinity",
        with_frame(5, np.inf),
        0.3,
        "row-without-value",
        warning_values={"subject": "line 7", "cell": "inf"},
    ),
    Case(
        "two rates as good as one",
        100 * np.exp(-0.022 * T) + 100 * np.exp(-0.018 * T) + 0.3 * NOISE,
        0.3,
        "rates-indistinct",
        ("--states", "2"),
        warning_values={"faster": 1, "remedy": "ask for one state fewer (--states 1)"},
    ),
    Case(
        "slow rate that could be zero",
        100 * np.exp(-0.05 * T) + 5 * np.exp(-0.0005 * T) + 0.3 * NOISE,
        0.3,
        "rate-unresolved",
        warning_values={"state": 2, "remedy": "record longer"},
    ),
    Case(
        "longer than recorded",
        100 * np.exp(-0.002 * T) + 0.3 * NOISE,
        0.3,
        "lifetime-beyond-record",
        warning_values={"span_s": pytest.approx(180)},
    ),
    Case(
        "too short to see it fall",
        100 * np.exp(-0.002 * T[:8]) + 0.3 * NOISE[:8],
        0.3,
        "lifetime-beyond-record",
        (),
        T[:8],
        {"span_s": pytest.approx(35)},
    ),
    Case(
        "three states of one",
        DECAY + 0.3 * NOISE,
        0.3,
        "rates-indistinct",
        ("--states", "3"),
        warning_values={"faster": 1},
    ),
    Case(
        "as many parameters as points",
        DECAY[:2],
        1.0,
        "no-degrees-of-freedom",
        (),
        T[:2],
    ),
    Case(
        "too much subtracted",
        100 * np.exp(-0.05 * T) - 20 + NOISE,
        1.0,
        "signal-below-zero",
    ),
]
#: A frame that lies off the others may be taken for flicker where that is measured.
DISTURBED = [
    *(
        Case(
            name,
            with_frame(row, value),
            0.3,
            "frame-outlier",
            warning_values={"t_s": pytest.approx(T[row])},
        )
        for name, row, value in (
            ("a flash", 15, 104.0),
            ("a lost decimal mark", 15, 2.1e9),
            ("a frame in the dark", 20, 0.0),
            ("a disturbed tail", 34, 8.0),
        )
    ),
]


def fitted(labrig: Labrig, folder: Path, case: Case, *options: str) -> Ended:
    rows = [f"{t},{value},{case.sigma}" for t, value in zip(case.t_s, case.values, strict=True)]
    (folder / "decay.csv").write_text("\n".join(["t_s,value,sigma", *rows]) + "\n")
    return labrig("fit", "decay", folder / "decay.csv", *case.options, *options)


@pytest.mark.parametrize("flicker", ["auto", "0"])
@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case.name)
def test_what_is_no_decay_is_refused_in_one_line(
    labrig: Labrig, tmp_path: Path, case: Case, flicker: str
) -> None:
    ended = fitted(labrig, tmp_path, case, "--flicker", flicker)
    # A table that is malformed is the user's, exit code 2; data that do not decay are 4.
    assert ended.code == (2 if "finite number" in case.expected else 4)
    assert ended.out == ""
    assert len(ended.err.splitlines()) == 1
    assert case.expected in ended.err


@pytest.mark.parametrize(
    ("case", "flicker"),
    [
        *((case, "auto") for case in (*WARNED, *DISTURBED)),
        *((case, "0") for case in (WARNED[-1], *DISTURBED)),
    ],
    ids=lambda value: value.name if isinstance(value, Case) else value,
)
def test_results_that_the_data_do_not_support_have_a_warning(
    labrig: Labrig, tmp_path: Path, case: Case, flicker: str
) -> None:
    ended = fitted(labrig, tmp_path, case, "--flicker", flicker, "--json")
    assert ended.code == 0, ended.err
    warnings = as_warnings(json.loads(ended.out)["warnings"])
    matching = [each for each in warnings if each.code == case.expected and case.matches(each)]
    assert len(matching) == 1, warnings
    assert "scatter-exceeds-sigma" not in codes(warnings), "of one cause, one warning"


def test_a_good_decay_is_not_complained_about(labrig: Labrig, tmp_path: Path) -> None:
    ended = fitted(labrig, tmp_path, Case("good", DECAY + 0.3 * NOISE, 0.3, ""))
    assert ended.code == 0
    assert "!" not in ended.out
