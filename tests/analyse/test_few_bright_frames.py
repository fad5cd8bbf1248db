"""A decay of which only two frames are bright: they determine its rate, and no flicker besides."""

import numpy as np
import pytest

from labrig.analyse import fit_series
from labrig.fit import fit_decay
from labrig.foundation.errors import FlickerUnknownError
from labrig.results import Series

T_S = np.append([0.56, 10.7], 18.0 + 4.5 * np.arange(20))
RATE_PER_S, FLICKER = 0.3, 0.007
LIGHT_DN_PER_S = np.array([980.0, 3900.0, 600.0])


def glow(seed: int) -> Series:
    """Return three channels of a frame every few seconds, with a flicker of 0.7 %."""
    rng = np.random.default_rng([seed, 42])
    n = len(T_S)
    light = np.outer(np.exp(-RATE_PER_S * T_S), LIGHT_DN_PER_S)
    light *= 1 + FLICKER * rng.standard_normal((n, 1))
    sigma = np.hypot([27.0, 20.0, 27.0], 0.3 * np.sqrt(light))
    values = light + sigma * rng.standard_normal(light.shape)
    none, names = np.zeros(n), ("",) * n
    return Series(
        t_s=T_S,
        exposure_s=none,
        values=values,
        sigma=sigma,
        dark_sigma=np.zeros(3),
        channels=("R", "G", "B"),
        iso=none,
        f_number=none,
        frame=names,
        unit=names,
        flag=names,
    )


def without_known_flicker(seed: int) -> Series | None:
    """Return the glow of a seed if nothing determines its flicker, else None."""
    series = glow(seed)
    try:
        fit_decay(series.t_s, series.values, series.sigma, channels="RGB", flicker=None)
    except FlickerUnknownError:
        return series
    return None


def test_typical_flicker_is_taken_where_nothing_determines_it() -> None:
    glows = [series for seed in range(10) if (series := without_known_flicker(seed)) is not None]
    assert glows
    for series in glows:
        (state,) = fit_series(series).states
        assert state.k_r_per_s == pytest.approx(RATE_PER_S, rel=0.15)
        assert abs(state.k_r_per_s - RATE_PER_S) < 3 * state.k_r_per_s_sigma
        assert state.k_r_per_s_sigma < 0.1 * RATE_PER_S
