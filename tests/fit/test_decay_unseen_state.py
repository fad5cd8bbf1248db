"""A state that is gone between two frames is stated, with the size of what it would change."""

import numpy as np
import pytest

from labrig.fit import DecayFit, fit_decay
from labrig.results import UnseenState
from tests.acceptance.decay_coverage import exponentials, fit, hidden_truth
from tests.fit import truths

DOUBLE = ((0.1, 1.0), (0.02, 0.5))
#: Beside these a state of 0.5/s is told in few of the fits.
FAST_DOUBLE = ((0.2, 1.0), (0.02, 0.3))


def _fitted(*states: tuple[float, float], seed: int) -> DecayFit:
    seen = truths.observe(truths.exponentials(*states), seed)
    return fit_decay(
        seen.t_s, seen.values, seen.sigma, exposure_s=1.5, channels="RGB", flicker=0.007,
        n_states=2,
    )  # fmt: skip


def _unseen(each: DecayFit) -> UnseenState:
    assert each.unseen_state is not None
    return each.unseen_state


def test_rates_change_as_stated_if_there_is_such_a_state() -> None:
    clean = _fitted(*DOUBLE, seed=7)
    unseen = _unseen(clean)
    share = unseen.share / 4
    planted = (1 / unseen.lifetime_s, share / (1 - share) * sum(a for _, a in DOUBLE))
    changed = _fitted(planted, *DOUBLE, seed=7)
    # What is stated takes the error of a fit without the state back.
    for with_it, without, change in zip(
        changed.rates, clean.rates, unseen.rate_changes, strict=True
    ):
        assert without.value / with_it.value - 1 == pytest.approx(change / 4, rel=0.2)


def test_errors_by_a_state_that_goes_unseen_are_within_what_is_stated() -> None:
    """A third of the errors are beyond 3 σ, most of them without a warning."""
    truth = hidden_truth(FAST_DOUBLE, 0.08)
    beyond, is_far = [], []
    for seed in range(700, 712):
        each = fit(truth, seed)
        found = np.array([(rate.value, rate.sigma) for rate in each.rates])[-2:]
        off = np.abs(found[:, 0] - [k for k, _ in FAST_DOUBLE]) / found[:, 1]
        stated = np.zeros(2)
        if each.unseen_state is not None:
            stated = np.abs(each.unseen_state.rate_changes[-2:]) * found[:, 0] / found[:, 1]
        is_far.append(off.max() > 3)
        beyond.append((off - stated).max() > 3 and not each.warnings)
    assert sum(is_far) >= 2
    assert sum(beyond) == 0


def test_a_state_three_times_as_strong_is_seen() -> None:
    unseen = _unseen(fit(exponentials(*DOUBLE), 800))
    share = 3 * unseen.share
    amplitude = share / (1 - share) * sum(a for _, a in DOUBLE)
    truth = exponentials((1 / unseen.lifetime_s, amplitude), *DOUBLE)
    fits = [fit(truth, seed) for seed in range(801, 805)]
    assert sum(bool(each.warnings) or each.n_states == 3 for each in fits) >= 3


def test_frames_close_together_leave_no_room() -> None:
    t_s = np.concatenate([0.1 + 0.1 * np.arange(100), 12.0 + 3.0 * np.arange(50)])
    seen = truths.observe(truths.exponentials((0.05, 1.0)), 9, t_s=t_s, exposure_s=0.1)
    dense = fit_decay(
        seen.t_s, seen.values, seen.sigma, exposure_s=0.1, channels="RGB", flicker=0.007
    )
    sparse = fit(exponentials((0.05, 1.0)), 9)
    assert abs(_unseen(dense).rate_changes[0]) < 0.2 * abs(_unseen(sparse).rate_changes[0])
    # Next to nothing is not told.
    assert "go unseen" in str(sparse)
    assert "go unseen" not in str(dense)
