"""Glow after lamp off: there, as bright as before, fading."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import DeviceError
from labrig.protocols.steps.afterglow import (
    Afterglow,
    Glow,
    classify_decay,
    classify_ladder,
    classify_repeats,
    dark_level,
    glow,
    has_gone_out,
)
from tests.protocols.metering import measure_frame

LADDER_S = (1 / 1290, 1 / 161, 1 / 20, 0.4, 3.2)
DARK = np.zeros((1, 2))
#: What the simulated lamp sends into the camera from a white sample at ISO 400 and f/4.
LAMP_DN_PER_S = 4.2e6


def seen(
    rate_dn_per_s: Callable[[float], float], times_s: Sequence[float], exposures_s: Sequence[float]
) -> list[Glow]:
    return [
        glow(measure_frame(time_s, exposure_s, rate_dn_per_s(time_s) * exposure_s), DARK, 0.0)
        for time_s, exposure_s in zip(times_s, exposures_s, strict=True)
    ]


def decay(
    rate_dn_per_s: Callable[[float], float], exposure_s: float = 1.0, for_s: float = 60.0
) -> Afterglow:
    times_s = [0.5, 5.5, for_s / 2, for_s - 5.0, for_s]
    five = seen(rate_dn_per_s, times_s, [exposure_s] * 5)
    return classify_decay(five[:2], five[2], five[3:], [])


def exponential(rate: float, k_per_s: float) -> Callable[[float], float]:
    return lambda time_s: rate * math.exp(-k_per_s * time_s)


@given(rate=st.floats(5, 2e4), k_per_s=st.floats(0.001, 0.5), for_s=st.floats(20, 3600))
def test_a_decay_is_accepted_however_dim_or_slow(rate: float, k_per_s: float, for_s: float) -> None:
    if 1 - math.exp(-k_per_s * (for_s - 5)) < 0.03:
        return
    found = decay(exponential(rate, k_per_s), exposure_s=0.5, for_s=for_s)
    assert found in (Afterglow.FADING, Afterglow.LINGERING)
    found.require(lambda _: None)


@pytest.mark.parametrize("rate", [3000.0, 900.0, 50.0])
def test_what_does_not_fade_is_refused(rate: float) -> None:
    found = decay(lambda _: rate)
    assert found is Afterglow.STEADY
    with pytest.raises(DeviceError, match="pull its plug"):
        found.require(pytest.fail)


def test_nothing_is_reported_of_a_short_decay_or_of_noise() -> None:
    assert decay(lambda _: 3000.0, for_s=8.0) is Afterglow.FADING
    assert decay(lambda _: 3.0) is Afterglow.FADING


@pytest.mark.parametrize("rate", [0.0, 0.5, -20.0])
def test_no_glow_is_refused(rate: float) -> None:
    found = decay(lambda _: rate)
    assert found is Afterglow.ABSENT
    with pytest.raises(DeviceError, match="the lamp did not light"):
        found.require(pytest.fail)


def test_a_light_that_came_on_during_the_decay_is_reported() -> None:
    said: list[str] = []
    found = decay(lambda t: 1000 * math.exp(-0.2 * t) + 500, for_s=180.0)
    assert found is Afterglow.LINGERING
    found.require(said.append)
    assert "a light may have come on" in said[0]
    assert decay(lambda t: 1000.0 if t < 10 else 20_000.0) is Afterglow.CLIPPED


@given(rate=st.floats(300, 2e5), k_per_s=st.floats(0.002, 0.5))
def test_metering_accepts_every_glow(rate: float, k_per_s: float) -> None:
    times_s = [0.5, 2.2, 3.9, 5.6, 7.7]
    assert classify_ladder(seen(exponential(rate, k_per_s), times_s, LADDER_S)) is Afterglow.FADING


def test_metering_doubts_a_lamp_and_a_closer_look_tells() -> None:
    times_s = [0.5, 2.2, 3.9, 5.6, 7.7]
    assert classify_ladder(seen(lambda _: LAMP_DN_PER_S, times_s, LADDER_S)) is Afterglow.CLIPPED
    assert classify_ladder(seen(lambda _: 0.0, times_s, LADDER_S)) is Afterglow.ABSENT

    def metering(rate: Callable[[float], float]) -> Afterglow:
        first, again = (seen(rate, [at_s] * 3, LADDER_S[:3]) for at_s in (12.0, 75.0))
        return classify_repeats(first, again)

    assert metering(lambda _: LAMP_DN_PER_S) is Afterglow.STEADY
    assert metering(lambda _: 100 * LAMP_DN_PER_S) is Afterglow.STEADY
    assert metering(exponential(LAMP_DN_PER_S, 0.002)) is Afterglow.FADING


@pytest.mark.parametrize(("fraction", "found"), [(0.3, Afterglow.WEAK), (0.8, Afterglow.FADING)])
def test_a_glow_is_held_against_the_metering(fraction: float, found: Afterglow) -> None:
    before = seen(exponential(5000, 0.03), [0.5, 2.2, 3.9, 5.6, 7.7], LADDER_S)
    now = seen(exponential(fraction * 5000, 0.03), [0.5, 5.5, 30, 55, 60], [0.8] * 5)
    assert classify_decay(now[:2], now[2], now[3:], before) is found


def test_a_lamp_that_has_gone_out_is_darker() -> None:
    lit, glowing, none, flickering = (
        seen(lambda _, rate=rate: rate, [0.0], [1 / 512])[0]  # type: ignore[misc]
        for rate in (LAMP_DN_PER_S, 1e5, 0.0, 0.97 * LAMP_DN_PER_S)
    )
    assert has_gone_out(lit, glowing)
    assert has_gone_out(lit, none)
    assert not has_gone_out(lit, lit)
    assert not has_gone_out(lit, flickering)


def test_dark_levels_lie_straight_between_those_taken() -> None:
    darks = [measure_frame(0.0, 0.05, 1.0), measure_frame(2.0, 3.25, 9.0)]
    assert dark_level(darks, 1.65)[0, 1] == pytest.approx(5.0)
    assert dark_level(darks, 1e-3)[0, 1] == 1.0
