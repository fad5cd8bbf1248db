"""For how long to charge: when doubling ends, and which charge tells most."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.arrays import FloatArray
from labrig.protocols.steps.charge_times import (
    CANDIDATES,
    fades_below_s,
    most_informative_s,
    still_grows,
)

DOUBLED_S: FloatArray = np.geomspace(8.0, 256.0, 6)


def glow(charge_s: FloatArray, rates_per_s: FloatArray) -> FloatArray:
    """Of one patch."""
    return 100 * (1 - np.exp(-np.multiply.outer(charge_s, rates_per_s)))[:, np.newaxis]


def test_doubling_ends_when_the_glow_has_stopped_growing() -> None:
    glows = glow(DOUBLED_S, np.full(9, 0.05))
    grew = [still_grows(glows[: n + 2], 0.03) for n in range(len(DOUBLED_S) - 1)]
    assert grew == [True, True, True, True, False]


def test_the_slowest_patch_decides_when_it_has_stopped_however_dim_it_is() -> None:
    quick, slow = glow(DOUBLED_S, np.full(9, 0.05)), 0.01 * glow(DOUBLED_S, np.full(9, 0.005))
    assert not still_grows(quick, 0.03)
    assert still_grows(np.concatenate([quick, slow], axis=1), 0.03)
    chosen_s = most_informative_s(list(DOUBLED_S), np.concatenate([slow, quick], axis=1))
    alone_s = [most_informative_s(list(DOUBLED_S), patch) for patch in (quick, slow)]
    assert min(alone_s) <= chosen_s <= max(alone_s)


@given(st.floats(0.005, 0.1), st.floats(1.0, 1.5))
def test_the_next_charge_is_the_one_that_tells_most(rate_per_s: float, spread: float) -> None:
    rates: FloatArray = np.array([rate_per_s, rate_per_s * spread, rate_per_s * spread**2])
    chosen_s = most_informative_s(list(DOUBLED_S), glow(DOUBLED_S, rates))
    candidates_s = np.geomspace(DOUBLED_S[0], DOUBLED_S[-1], CANDIDATES)
    determinants = [_log_determinants(np.append(DOUBLED_S, one_s), rates) for one_s in candidates_s]
    best_s = candidates_s[int(np.argmax(determinants))]
    assert chosen_s == pytest.approx(best_s, rel=0.5)


def _log_determinants(charge_durations_s: FloatArray, rates: FloatArray) -> float:
    """Of the information about ln a and ln s at every place, derivatives by differences."""
    total = 0.0
    for rate in rates:
        h = 1e-5
        up, down = (
            np.log(glow(charge_durations_s, np.full(1, rate * np.exp(d))))[:, 0] for d in (h, -h)
        )
        slopes = np.hstack([np.ones((len(charge_durations_s), 1)), (up - down) / (2 * h)])
        total += float(np.linalg.slogdet(slopes.T @ slopes)[1])
    return total


def test_dim_places_have_no_say() -> None:
    bright = glow(DOUBLED_S, np.full(6, 0.02))
    noise = np.random.default_rng(1).normal(0.0, 0.1, (len(DOUBLED_S), 1, 20))
    both = np.concatenate([noise, bright], axis=2)
    assert most_informative_s(list(DOUBLED_S), both) == most_informative_s(list(DOUBLED_S), bright)


def test_a_rest_lasts_until_the_slowest_patch_has_faded() -> None:
    t_s, rates_per_s = np.array([0.0, 60.0, 80.0]), np.array([0.1, 0.02])
    glows = 100 * np.exp(-np.outer(t_s, rates_per_s))
    assert fades_below_s(glows, 20.0, 0.02) == pytest.approx(np.log(50) / 0.02 - 80)
    # What is dark already, or noise about nothing, is not waited for.
    assert fades_below_s(glows[:, :1], 20.0, 0.02) == 0
    assert fades_below_s(np.array([[100.0], [0.1], [-0.1]]), 20.0, 0.02) == 0


def test_a_glow_that_does_not_fade_is_waited_for_as_long_as_may_be() -> None:
    assert fades_below_s(np.array([[100.0], [50.0], [50.0]]), 20.0, 0.02) == np.inf
