"""Light in dark frames: told from what sensors make by themselves, and glow from lamps."""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import DataError, DeviceError
from labrig.protocols.steps.darkness import DARK, Darkness, darkness
from tests.protocols.metering import RANGE_DN, measure_frame

EXPOSURES_S = (0.05, 0.8, 3.2)
#: From the end of one exposure to the start of the next.
PAUSE_S = 1.2


def taken(
    rate_dn_per_s: Callable[[float], float],
    exposures_s: Sequence[float] = EXPOSURES_S,
    offset_dn: float = 0.0,
    flicker: Callable[[], float] = lambda: 1.0,
    **seen: float,
) -> Darkness:
    """What four frames at each exposure show of that light over time."""
    metering, now_s = [], 0.0
    for exposure_s in exposures_s:
        for _ in range(4):
            light = rate_dn_per_s(now_s + exposure_s / 2) * exposure_s * flicker()
            metering.append(measure_frame(now_s, exposure_s, offset_dn + light, **seen))
            now_s += exposure_s + PAUSE_S
    return darkness(metering, 400)


def told(found: Darkness) -> list[str]:
    said: list[str] = []
    found.require(said.append)
    return said


@given(
    dark_dn_per_s=st.floats(0, 9),
    offset_dn=st.floats(-150, 900),
    hot=st.floats(0, 0.005),
    longest_s=st.sampled_from([0.1, 3.2, 30.0]),
)
def test_no_sensor_looks_like_a_light(
    dark_dn_per_s: float, offset_dn: float, hot: float, longest_s: float
) -> None:
    """At ISO 400: up to 9 electrons a second, a wrong black level, half a per cent hot pixels."""
    exposures_s = (longest_s / 64, longest_s / 4, longest_s)
    found = taken(lambda _: dark_dn_per_s, exposures_s, offset_dn, hot=hot)
    assert found == DARK
    assert told(found) == []


@given(dark_dn_per_s=st.floats(0, 9), offset_dn=st.floats(-70, 60))
def test_nor_with_one_exposure(dark_dn_per_s: float, offset_dn: float) -> None:
    assert taken(lambda _: dark_dn_per_s, (1.0,), offset_dn) == DARK


def test_a_file_that_calls_no_level_black_tells_nothing() -> None:
    assert taken(lambda _: 0.0, (1.0,), 1024.0, black=0.0) == DARK


@given(seed=st.integers(0, 10_000), rate=st.floats(1500, 4e6))
def test_a_lamp_is_refused_whatever_its_flicker(seed: int, rate: float) -> None:
    rng = random.Random(seed)
    found = taken(lambda _: rate, flicker=lambda: rng.gauss(1.0, 0.007))
    assert found.is_bright
    with pytest.raises((DeviceError, DataError)) as refusal:
        found.require(pytest.fail)
    assert found.fades or "the lamp is on although its relay reads off" in str(refusal.value)


@given(rate=st.floats(0, 2e5), k_per_s=st.floats(0.002, 0.5))
def test_a_glow_is_never_called_a_lamp_without_a_closer_look(rate: float, k_per_s: float) -> None:
    found = taken(lambda time_s: rate * math.exp(-k_per_s * time_s))
    try:
        said = told(replace(found, fades=True) if found.is_doubtful else found)
    except DataError as refusal:
        assert "still glows too brightly" in str(refusal)
    else:
        assert "lamp" not in " ".join(said)


@pytest.mark.parametrize(
    ("k_per_s", "said"), [(0.02, "still glows from earlier"), (0.0, "some light is left")]
)
def test_a_little_light_is_reported_and_subtracted(k_per_s: float, said: str) -> None:
    (warning,) = told(taken(lambda t: 300 * math.exp(-k_per_s * t)))
    assert said in warning
    assert "% of the range in 3.2 s" in warning


def test_what_is_left_is_a_share_of_the_range() -> None:
    found = taken(lambda _: RANGE_DN / 10, (0.01, 1.0))
    assert found.light == pytest.approx(0.099)
    assert str(found) == "9.9 % of the range in 1 s"
