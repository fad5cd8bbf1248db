"""The field against sampling of the history, and exact steps against Euler's and Runge-Kutta's."""

import numpy as np
import pytest

from tests.acceptance.euler_steps import METHODS, case_of, worst
from tests.acceptance.history_sampling import Scene, disk, rms_percent, stepped

ANGLE = disk(16)[0]
ALL = np.arange(len(ANGLE))
AT_S = 3.0


def test_in_weak_light_field_and_history_have_one_mean() -> None:
    scene = Scene.of("double-wide", 1e-4, ANGLE)
    truth = scene.truth(AT_S, ALL)
    (field,), _ = stepped(scene, (AT_S,))
    assert rms_percent(field, truth) < 0.1
    for how in (False, True):
        errors = scene.history(AT_S, 400, 3, stratified=how) / truth - 1
        assert abs(errors.mean()) < 3 * errors.std() / np.sqrt(len(errors))
    assert rms_percent(scene.history(AT_S, 400, 4, stratified=True), truth) < 1


def test_where_states_saturate_the_history_is_wrong_and_the_field_is_not() -> None:
    scene = Scene.of("yellow-paint", 1.0, ANGLE)
    truth = scene.truth(AT_S, ALL)
    (field,), _ = stepped(scene, (AT_S,))
    assert rms_percent(field, truth) < 0.1
    law = scene.history(AT_S, 2000, 5, stratified=True)
    # κ/k = 1: the true level is about half the way to what the light alone would give.
    assert 1.2 < law.mean() / truth.mean() < 1.8


@pytest.mark.parametrize(("method", "order"), [("Euler", 1), ("exact", 2), ("Runge-Kutta", 4)])
def test_errors_in_swinging_light_fall_with_the_order_of_the_method(
    method: str, order: int
) -> None:
    case = case_of("yellow-paint", 10.0, swings=True)
    coarse, fine = (worst(case, METHODS[method], step_s) for step_s in (0.4, 0.2))
    assert coarse / fine == pytest.approx(2**order, rel=0.25)


def test_in_steady_light_only_rounding_is_left_of_an_exact_step() -> None:
    case = case_of("green-paint", 10.0, swings=False)
    assert worst(case, METHODS["exact"], 5.0) < 2e-7
    assert worst(case, METHODS["Euler"], 0.4) > 0.01
