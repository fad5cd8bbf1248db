"""A step of a field of samples, against a copy of the same bytes and against NumPy."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from labrig.reproduce import Field, FieldParameters

Against = Callable[..., None]

SAMPLES, BANDS = 4_700_000, 8
THREADS = 2


def test_step_of_two_states(against: Against) -> None:
    """It reads the light and the levels, and writes the levels: as many bytes as the copy moves."""
    rng = np.random.default_rng(1)
    light = rng.random((BANDS, SAMPLES), dtype=np.float32)
    k_e = rng.uniform(0, 0.01, (2, BANDS)).astype(np.float32)
    k_r = np.array([0.08, 0.015], np.float32)
    field = Field(FieldParameters.checked(k_r, k_e, np.ones((2, BANDS))), SAMPLES)
    source = rng.random((BANDS // 2 + 2, SAMPLES), dtype=np.float32)
    target = np.empty_like(source)
    rows = [slice(0, len(source) // 2), slice(len(source) // 2, None)]
    levels = np.zeros((2, SAMPLES), np.float32)
    with ThreadPoolExecutor(THREADS) as pool:

        def copy() -> None:
            list(pool.map(lambda part: np.copyto(target[part], source[part]), rows))

        def with_numpy() -> None:
            kappa = k_e @ light
            total = kappa + k_r[:, None]
            steady = kappa / total
            np.multiply(levels - steady, np.exp(-0.5 * total), out=levels)
            np.add(levels, steady, out=levels)

        ours: Any = lambda: field.step(light, 0.5)  # noqa: E731
        against(
            ours,
            {"copy of the same bytes, two threads": copy, "NumPy": with_numpy},
            rounds=10,
            what="4.7 million samples, 8 bands, 2 states: step",
        )
