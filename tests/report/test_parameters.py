"""Sentences about the number of states, and the noise that a fit was given."""

from dataclasses import replace

import pytest

from labrig.report.parameters import n_states_reason
from labrig.results import Candidate
from tests.results.made import decay_result


@pytest.mark.parametrize(
    ("tried", "told"),
    [
        ((), "One more state was not asked for, or gains nothing"),
        ((1,), "One more state was not asked for, or gains nothing"),
        ((1, 2), "One more state raises BIC"),
        ((3,), "The data do not support 3 states"),
    ],
)
def test_the_numbers_of_states_that_were_tried_are_told(tried: tuple[int, ...], told: str) -> None:
    candidates = tuple(Candidate(number, 1.0, 100.0 + 10 * number, None) for number in tried)
    fit = replace(decay_result((0.05, 1.0)), candidates=candidates)
    assert n_states_reason(fit).startswith(told)


def test_a_flicker_that_was_given_is_told_as_held() -> None:
    fit = replace(decay_result((0.05, 1.0)), flicker=0.00894869, flicker_sigma=0.0)
    assert "flicker  0.89 % (held)" in str(fit)
