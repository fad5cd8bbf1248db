"""Which photographs stand for a charge."""

import numpy as np

from labrig.results import Charge, ChargingSeries, Transient

EMPTY = np.empty((0, 1, 1))


def series(*begins_s: tuple[float, ...]) -> ChargingSeries:
    """Charges of 10 s, photographed so long after each."""
    charges = tuple(
        Charge(on_s, on_s + 10, on_s + 10 + np.array(begins), np.ones(len(begins)))
        for on_s, begins in zip(np.arange(0.0, 1e6, 1e3), begins_s, strict=False)
    )
    at_once = Transient.none(1)
    return ChargingSeries("any", charges, at_once, at_once, np.ones((1, 1)), EMPTY, EMPTY)


def test_the_first_usable_one_of_each_charge() -> None:
    found = series((1, 5), (1, 5)).first_frames(np.array([False, True, True, True]))
    assert found == {0: 1, 1: 2}


def test_a_charge_that_was_looked_at_much_later_is_left_out() -> None:
    every = np.ones(5, dtype=bool)
    assert series((87,), (1, 5), (1.2, 5)).first_frames(every) == {1: 1, 2: 3}


def test_nothing_usable() -> None:
    assert series((1, 5)).first_frames(np.zeros(2, dtype=bool)) == {}
