"""The uncertainty of a number by its causes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.fit import fit_luminance
from labrig.foundation import plugins
from labrig.protocols.fade.result import FittedShape, LampChange, SwitchedFrames
from labrig.protocols.isotropy.result import AngularGlow, IsotropyResult
from labrig.report.run_sections import budget_lines
from labrig.results import Budget, DensityBasis, LayerEffect, LuminanceDecay, Measured, RunResult
from tests.results.made_excitation import excitation_result

PARTS = st.none() | st.floats(0.0, 1e6)


@given(st.floats(-1e6, 1e6), PARTS, PARTS, PARTS, PARTS)
def test_sigma_is_the_root_sum_of_squares_and_what_is_missing_has_a_name(
    value: float,
    noise: float | None,
    calibration: float | None,
    model: float | None,
    undivided: float | None,
) -> None:
    budget = Budget(value, noise=noise, calibration=calibration, model=model, undivided=undivided)
    given_parts = [part for part in (noise, calibration, model, undivided) if part is not None]
    assert budget.sigma == pytest.approx(math.hypot(*given_parts) if given_parts else math.inf)
    for name, part in (("noise", noise), ("calibration", calibration)):
        assert (name in budget.not_included) == (part is None and undivided is None)
    assert ("model" in budget.not_included) == (model is None)
    assert str(budget)


@given(st.floats(0.0, 1e3), st.none() | st.floats(0.0, 2e3))
def test_a_stated_sigma_is_divided_and_nothing_counts_twice(
    sigma: float, calibration: float | None
) -> None:
    budget = Budget.of(Measured(5.0, sigma, "s"), calibration)
    assert budget.sigma == pytest.approx(sigma, rel=1e-9)
    assert ("calibration" in budget.not_included) == (calibration is None)
    if calibration is not None:
        assert budget.calibration == min(calibration, sigma)


def test_a_range_by_the_model_is_beside_sigma_and_comes_first() -> None:
    budget = Budget.of(
        Measured(0.02, 0.0004, "1/s"), 0.0002, model_range=(0.02, 0.05), model_of="thickness"
    )
    assert budget.sigma == pytest.approx(0.0004)
    assert budget.trusted == pytest.approx((0.0196, 0.0504))
    assert budget.not_included == ()
    assert str(budget).startswith("0.02 to 0.05 1/s by thickness; ")
    assert list(budget.to_dict()).index("model_range") < list(budget.to_dict()).index("sigma")


def luminance(seed: int, scale: float, scale_sigma: float, noise: float = 0.02) -> LuminanceDecay:
    """An afterglow whose readings share a factor, with noise of their own."""
    t_s = np.geomspace(60.0, 40_000.0, 60)
    light = 300 * (1 + t_s / 60) ** -1.1
    random = np.random.default_rng(seed)
    read = scale * light * (1 + noise * random.standard_normal(len(t_s)))
    return fit_luminance(t_s, read, noise * light, scale_sigma=scale_sigma)


NAMES = ("luminance at 10 min", "light sum")


def test_each_component_of_a_luminance_is_the_scatter_by_its_own_cause() -> None:
    names = [f"luminance at {time}" for time in ("2 min", "10 min", "30 min", "1 h")]
    exact = luminance(0, 1.0, 0.05, noise=1e-6).budgets()
    pulls = []
    for seed in range(20):
        found = luminance(seed, 1.0, 0.05).budgets()
        pulls.append(
            [(found[name].value - exact[name].value) / (found[name].noise or 0.0) for name in names]
        )
    assert float(np.sqrt(np.mean(np.square(pulls)))) == pytest.approx(1.0, abs=0.17)
    # A scale that is off by one σ moves every luminance by its calibration component.
    off = luminance(0, 1.05, 0.05, noise=1e-6).budgets()
    for name in (*names, "light sum"):
        moved = off[name].value - exact[name].value
        assert moved == pytest.approx(exact[name].calibration, rel=0.01)


def test_without_a_calibration_only_its_component_changes() -> None:
    with_scale, without = luminance(3, 1.0, 0.05).budgets(), luminance(3, 1.0, 0.0).budgets()
    for name in NAMES:
        assert with_scale[name].noise == pytest.approx(without[name].noise, rel=0.02)
        assert with_scale[name].calibration > 0.02 * without[name].value  # type: ignore[operator]
        assert without[name].calibration is None
        assert "calibration" in without[name].not_included


def test_an_excitation_says_what_thickness_leaves_and_that_it_was_not_looked_at() -> None:
    result = excitation_result()
    patch, fit = result.patches["left"], result.patches["left"].fit
    k_e = fit.states[0].k_e_per_s
    known = replace(fit.states[0], k_r_per_s_sigma=0.001, k_e_per_s_sigma=0.05 * k_e + 1e-6)
    fit = replace(fit, states=(known,))
    bare = replace(result, patches={"": replace(patch, fit=fit)}).budgets()
    assert any("thickness" in budget.not_included for budget in bare.values())
    states, bands = fit.k_e().shape
    layer = LayerEffect(
        (0.0, 1.0),
        DensityBasis.PRIOR,
        np.stack([np.ones((states, bands)), np.full((states, bands), 2.0)]),
        np.stack([np.ones(states), np.full(states, 1.3)]),
    )
    patch = replace(patch, fit=replace(fit, layer=layer))
    of_layer = replace(result, patches={"": patch}).budgets()
    rates = {name: budget for name, budget in of_layer.items() if name.startswith("k_e")}
    assert rates
    for budget in rates.values():
        assert budget.model_range == pytest.approx((budget.value, 2 * budget.value))
        assert budget.not_included == ("kinetic order", "scattering in the sample")
    assert of_layer["k_r of state 1"].not_included == ("calibration", "model")
    light = np.array(result.irradiance.direct_sigma) / np.array(result.irradiance.direct)
    seen = np.flatnonzero(fit.states[0].seen)
    for budget, band in zip(rates.values(), seen, strict=False):
        assert budget.calibration == pytest.approx(min(light[band] * budget.value, budget.sigma))


def test_a_result_file_has_the_budgets_and_is_read_without_them() -> None:
    result: RunResult = excitation_result()
    content = result.to_dict()
    assert set(content["budgets"]) == set(result.budgets())
    for entry in content["budgets"].values():
        parts = [entry[name] or 0.0 for name in ("noise", "calibration", "undivided", "model")]
        if all(isinstance(part, float) for part in parts):
            assert entry["sigma"] == pytest.approx(math.hypot(*parts))
    assert type(result).from_dict(content).budgets().keys() == result.budgets().keys()


CALIBRATIONS = (
    *("blank", "camera_calibration", "fade"),
    *("irradiance", "isotropy", "lvf_calibration"),
)


@pytest.mark.parametrize("kind", CALIBRATIONS)
def test_every_calibration_has_budgets(kind: str) -> None:
    result_type = plugins.measurement(kind).load("result")
    assert result_type.budgets is not RunResult.budgets


def test_the_view_that_deviates_most_has_a_budget_and_a_line_for_the_terminal() -> None:
    glow = AngularGlow(
        np.array([0, 30, 60]),
        np.array([1.0, 0.97, 1.02]),
        np.array([0.0, 0.01, 0.02]),
        Measured(1.0, 0.001),
    )
    result = IsotropyResult(patches={"a": glow}, encloses_sample=False)
    ((name, budget),) = result.budgets().items()
    assert name.startswith("a: ")
    assert (budget.value, budget.noise) == (0.97, 0.01)
    (line,) = budget_lines(result)
    assert name in line
    assert budget.value_text in line


def test_shapes_of_a_fade_that_differ_are_the_model_part_of_its_exponent() -> None:
    frames = SwitchedFrames(
        *(np.zeros(1), np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1), np.zeros(1)),
        *(np.zeros(1, int), np.ones(1, int), 0),
    )
    shapes = tuple(
        FittedShape(name, np.array([p, 0.0]), np.diag([0.03**2, 1.0]), 0.0, 1.0, 1, 0.5)
        for name, p in (("filament", 0.9), ("polynomial", 1.1))
    )
    change = LampChange(frames, shapes, Measured(1.0, 0.1044), Measured(0.0, 1.0))
    budget = change.exponent_budget()
    assert budget.noise == pytest.approx(0.03)
    assert budget.model == pytest.approx(0.1)
    assert budget.sigma == pytest.approx(0.1044, rel=1e-3)
