"""The least-squares core: certified digits, bounds, rank."""

from pathlib import Path

import numpy as np
import pytest

from labrig.fit.nonlinear_least_squares import Ending, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from tests.fit import strd

CERTIFIED_DIGITS = 9


def test_no_reference_set_is_left_out(real_data: Path) -> None:
    assert {path.stem for path in (real_data / "nist_strd").glob("*.dat")} == set(strd.MODELS)


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("name", strd.MODELS)
def test_certified_digits(real_data: Path, name: str, start: int) -> None:
    reference = strd.read(real_data / f"nist_strd/{name}.dat")
    fit = least_squares(reference.residuals, reference.starts[start])
    assert fit.converged
    assert fit.rank == len(reference.certified)
    assert reference.certified_digits(fit.parameters) >= CERTIFIED_DIGITS
    if name != "Lanczos1":  # Its residuals, 1e-13, are the rounding of its data.
        sigma = fit.sigma * np.sqrt(fit.reduced_chi2)
        np.testing.assert_allclose(sigma, reference.certified_sigma, rtol=1e-8)


TIMES = np.linspace(0, 4, 30)


def _exponential(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    amplitude, rate = parameters
    decayed = np.exp(-rate * TIMES)
    return amplitude * decayed - 3 * np.exp(-0.7 * TIMES), np.stack(
        [decayed, -amplitude * TIMES * decayed], axis=1
    )


def test_bound_holds_a_parameter_and_frees_it_again() -> None:
    held = least_squares(_exponential, [1.0, 0.2], upper=[np.inf, 0.5])
    assert held.at_bound.tolist() == [False, True]
    assert held.parameters[1] == 0.5
    # At the held rate the amplitude is the linear optimum.
    decayed = np.exp(-0.5 * TIMES)
    best = 3 * np.exp(-0.7 * TIMES) @ decayed / (decayed @ decayed)
    assert held.parameters[0] == pytest.approx(best, rel=1e-12)
    freed = least_squares(_exponential, [1.0, 0.5], lower=[0, 0.5])
    assert freed.parameters == pytest.approx([3, 0.7], rel=1e-12)
    assert not freed.at_bound.any()


def test_parameter_without_effect_has_infinite_variance() -> None:
    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        r, jacobian = _exponential(parameters[:2])
        return r, np.column_stack([jacobian, np.zeros(len(r))])

    fit = least_squares(residuals, [1.0, 0.2, 5.0])
    assert fit.rank == 2
    assert fit.dof == len(TIMES) - 2
    assert fit.parameters == pytest.approx([3, 0.7, 5], rel=1e-12)
    assert np.isinf(fit.covariance[2, 2])
    assert np.all(np.isfinite(fit.covariance[:2, :2]))


def test_covariance_is_that_of_the_linear_model() -> None:
    design = np.random.default_rng(3).normal(size=(40, 4))
    target = np.arange(40.0)
    fit = least_squares(lambda x: (design @ x - target, design), np.zeros(4))
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(design.T @ design), rtol=1e-11)
    np.testing.assert_allclose(fit.parameters, np.linalg.lstsq(design, target)[0], rtol=1e-12)


def test_overflow_at_a_trial_point_is_only_refused() -> None:
    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        grown = np.exp(parameters[0] * 20 * TIMES)
        return grown - np.exp(20 * TIMES * 0.1), (20 * TIMES * grown)[:, None]

    assert least_squares(residuals, [0.0]).parameters == pytest.approx([0.1], rel=1e-12)


def test_start_must_be_finite() -> None:
    with pytest.raises(FitError, match="expected finite residuals"):
        least_squares(lambda x: (np.log(x), np.diag(1 / x)), [0.0])


@pytest.mark.parametrize("curvature", [0.05, 0.12, 0.15])
def test_steps_that_alternate_about_a_minimum_do_not_creep(curvature: float) -> None:
    """Where residuals are large, undamped steps shrink slowly, or grow; the minimum is at 0."""

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.array([x[0], curvature * x[0] ** 2 + 5]), np.array([[1], [2 * curvature * x[0]]])

    fit = least_squares(residuals, [3.0], tolerance=1e-6)
    assert abs(fit.parameters[0]) < 0.01
    assert not fit.creeps


@pytest.mark.parametrize("seed", [2, 3, 5])
def test_a_step_that_gains_nothing_is_no_creeping(seed: int) -> None:
    """Slopes that leave out how weights depend on the parameters lead past the minimum."""
    t = np.linspace(0, 5, 60)
    y = np.random.default_rng(seed).poisson(100 * np.exp(-t) + 2)

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        model = x[0] * np.exp(-x[1] * t) + 2
        weight = 1 / np.sqrt(model)
        slopes = np.column_stack([np.exp(-x[1] * t), -t * (model - 2)])
        return weight * (model - y), weight[:, np.newaxis] * slopes

    stopped = least_squares(residuals, [101.0, 1.01], max_iterations=20, tolerance=1e-6)
    assert stopped.ending is Ending.SLOW_PROGRESS
    step = np.linalg.lstsq(stopped.jacobian, stopped.residuals)[0]
    assert np.linalg.norm(stopped.jacobian @ step) ** 2 > 0.02
    assert not stopped.creeps


def test_a_search_that_is_cut_off_in_a_valley_creeps() -> None:
    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array([[-20 * x[0], 10], [-1, 0]])

    assert least_squares(residuals, [-1.2, 1.0], max_iterations=8, tolerance=1e-6).creeps
    assert not least_squares(residuals, [-1.2, 1.0], tolerance=1e-6).creeps
