"""Edits spread over what looks alike and is near, and nowhere else."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.design import Reach, propagate
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError


def halves(size: int = 24) -> FloatArray:
    """A picture whose left half is black and whose right half is white."""
    picture = np.zeros((size, size, 3))
    picture[:, size // 2 :] = 1.0
    return picture


def brush(size: int = 24, weight: float = 1.0) -> FloatArray:
    weights = np.zeros((size, size))
    weights[3:6, 3:6] = weight
    return weights


def test_an_edit_fills_its_half_and_leaves_the_other() -> None:
    values = np.random.default_rng(0).normal(size=(24, 24, 7))
    change = np.arange(1.0, 8.0)
    edited = propagate(values, halves(), values + change, brush())
    np.testing.assert_allclose((edited - values)[:, :12] / change, 1, atol=0.02)
    np.testing.assert_allclose(edited[:, 12:], values[:, 12:], atol=0.02)


def test_it_is_the_minimum_of_the_sum_of_squares() -> None:
    """No other change is lower: the sum is built texel by texel from the formula."""
    rng = np.random.default_rng(1)
    size, reach = 9, Reach(0.3, 4.0)
    appearance, values = rng.uniform(size=(size, size, 2)), rng.normal(size=(size, size, 1))
    wanted, weights = rng.normal(size=(size, size, 1)), np.zeros((size, size))
    weights[2, 3], weights[6, 6] = 1.0, 0.4
    edited = propagate(values, appearance, wanted, weights, reach)
    pairs = [(i, j, z) for i in range(81) for j, z in neighbours(appearance, i, size, reach)]

    def cost(e: FloatArray) -> float:
        kept = 1e-4 * float(((e - values) ** 2).sum())
        met = float((weights * (e - wanted)[..., 0] ** 2).sum())
        flat = (e - values).ravel()
        return kept + met + sum(z * float(flat[i] - flat[j]) ** 2 for i, j, z in pairs)

    least = cost(edited)
    for _ in range(30):
        assert cost(edited + 1e-3 * rng.normal(size=edited.shape)) > least


def neighbours(
    appearance: FloatArray, texel: int, size: int, reach: Reach
) -> list[tuple[int, float]]:
    """The ten nearest texels of one, and their affinities, by comparison with all."""
    places = np.array([(i // size, i % size) for i in range(size**2)])
    flat = appearance.reshape(size**2, -1)
    squares = ((flat - flat[texel]) ** 2).sum(axis=1) / reach.appearance**2
    squares += ((places - places[texel]) ** 2).sum(axis=1) / reach.position**2
    nearest = np.argsort(squares, kind="stable")[1:11]
    return [(int(i), float(np.exp(-squares[i]))) for i in nearest]


def test_a_fainter_brush_wins_less_against_another() -> None:
    weights = brush()
    weights[18:21, 3:6] = 0.1
    wanted = np.zeros((24, 24, 1))
    wanted[:12], wanted[12:] = 1.0, -1.0
    alike, values = np.zeros((24, 24, 1)), np.zeros((24, 24, 1))
    edited = propagate(values, alike, wanted, weights, Reach(1.0, 200.0))
    assert 0.2 < edited.mean() < 0.9


def test_a_short_reach_stays_near() -> None:
    values, alike = np.zeros((24, 24, 1)), np.zeros((24, 24, 1))
    edited = propagate(values, alike, values + 1, brush(), Reach(1.0, 0.4))
    assert edited[4, 4, 0] > 0.9
    assert abs(edited[20, 20, 0]) < 0.05


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 10**6), st.floats(1e-3, 1.0))
def test_a_change_lies_between_none_and_the_wanted_one(
    rows: int, columns: int, seed: int, weight: float
) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(rows, columns, 2))
    weights = np.zeros((rows, columns))
    weights[rng.integers(rows), rng.integers(columns)] = weight
    edited = propagate(values, rng.uniform(size=(rows, columns, 1)), values + 1, weights)
    assert (edited - values).min() > -1e-3
    assert (edited - values).max() < 1 + 1e-3


@pytest.mark.parametrize(
    "changes",
    [
        {"values": np.zeros((4, 4))},
        {"wanted": np.zeros((4, 4, 2))},
        {"weights": np.zeros((4, 5))},
        {"weights": np.zeros((4, 4))},
        {"weights": np.full((4, 4), 2.0)},
        {"appearance": np.full((4, 4, 1), np.nan)},
        {"reach": Reach(0.0, 1.0)},
    ],
    ids=["flat", "channels", "shape", "no edit", "too heavy", "NaN", "no reach"],
)
def test_improper_textures_are_refused(changes: dict[str, object]) -> None:
    arguments: dict[str, object] = {
        "values": np.zeros((4, 4, 1)),
        "appearance": np.zeros((4, 4, 1)),
        "wanted": np.ones((4, 4, 1)),
        "weights": np.ones((4, 4)),
    }
    with pytest.raises(UsageError, match="expected"):
        propagate(**(arguments | changes))  # type: ignore[arg-type]
