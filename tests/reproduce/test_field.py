"""Levels of many samples under changing light, against an integrator that knows no closed form."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Material, read_material
from labrig.reproduce import Field, FieldParameters

BANDS, SAMPLES = 8, 200
STEPS_S = (0.02, 0.5, 3.0, 40.0, 0.5, 600.0)


def parameters(order: tuple[float, ...], seed: int = 1, **texture: bool) -> FieldParameters:
    rng = np.random.default_rng(seed)
    n = len(order)
    k_e = rng.uniform(0, 0.02, (n, BANDS))
    k_r = np.geomspace(0.12, 0.008, n)
    emitted = rng.uniform(0, 2, (n, BANDS))
    if texture.get("k_e"):
        k_e = k_e[:, :, None] * rng.uniform(0.2, 2, SAMPLES)
    if texture.get("k_r"):
        k_r = k_r[:, None] * rng.uniform(0.5, 2, SAMPLES)
    if texture.get("emitted"):
        emitted = emitted[:, :, None] * rng.uniform(0, 1, SAMPLES)
    return FieldParameters.checked(k_r, k_e, emitted, order)


def spoilt(value: float) -> FloatArray:
    light = np.ones((BANDS, 2))
    light[3, 1] = value
    return light


def without_spectrum() -> Material:
    material = read_material("blue-paint")
    states = tuple(state.model_copy(update={"reradiation": None}) for state in material.states)
    return material.model_copy(update={"states": states})


def light_of(step: int, seed: int = 3) -> FloatArray:
    """Light of four decades, with dark samples and dark steps."""
    rng = np.random.default_rng((seed, step))
    light = 10 ** rng.uniform(-2, 2, (BANDS, SAMPLES))
    light[:, rng.random(SAMPLES) < 0.2] = 0.0
    return light * (step % 3 != 2)


def integrated(of: FieldParameters, start: FloatArray, light: FloatArray, t_s: float) -> FloatArray:
    """Levels after a step, by an integrator of order eight."""
    k_e = np.broadcast_to(
        np.atleast_3d(of.k_e_per_s).astype(float), (*of.k_e_per_s.shape[:2], SAMPLES)
    )
    kappa = np.einsum("ibs,bs->is", k_e, light)
    k_r = np.broadcast_to(np.atleast_2d(of.k_r_per_s.T).T.astype(float), kappa.shape)
    order = of.order[:, None]

    def growth(_: float, flat: FloatArray) -> FloatArray:
        level = flat.reshape(kappa.shape)
        return np.asarray(((1 - level) * kappa - k_r * np.maximum(level, 0) ** order).ravel())

    # Relative to the fastest relaxation, which the method has to follow.
    solution = solve_ivp(
        growth, (0, t_s), start.ravel(), "DOP853", rtol=1e-9, atol=1e-9, t_eval=[t_s]
    )
    return np.asarray(solution.y[:, -1].reshape(kappa.shape))


@pytest.mark.parametrize(
    ("order", "texture", "error"),
    [
        pytest.param((1.0, 1.0), {}, 1e-6, marks=pytest.mark.campaign),
        ((1.0, 1.0), {"k_e": True, "k_r": True, "emitted": True}, 1e-6),
        ((2.0,), {}, 1e-4),
        pytest.param((1.0, 1.5), {}, 1e-4, marks=pytest.mark.campaign),
        ((1.1, 2.7), {"k_e": True}, 1e-4),
    ],
)
def test_steps_against_an_integrator(
    order: tuple[float, ...], texture: dict[str, bool], error: float
) -> None:
    of = parameters(order, **texture)
    field = Field(of, SAMPLES)
    levels = np.zeros((len(order), SAMPLES))
    for step, t_s in enumerate(STEPS_S):
        light = light_of(step) * min(1.0, 20 / t_s)
        levels = integrated(of, levels, light, t_s)
        field.step(light, t_s)
        assert np.abs(field.levels - levels).max() < error
    emitted = np.einsum(
        "ibs,is->bs",
        np.broadcast_to(np.atleast_3d(of.reradiation), (len(order), BANDS, SAMPLES)),
        np.atleast_2d(of.k_r_per_s.T).T * levels ** of.order[:, None],
    )
    assert field.radiance() == pytest.approx(emitted, rel=1e-3, abs=1e-4 * emitted.max())


def test_few_samples_of_a_higher_order_need_no_table() -> None:
    of, some = parameters((1.0, 1.5)), 20
    field = Field(of, some)
    levels = np.zeros((2, SAMPLES))
    for step, t_s in enumerate(STEPS_S):
        light = light_of(step) * min(1.0, 20 / t_s)
        levels = integrated(of, levels, light, t_s)
        field.step(light[:, :some], t_s)
        assert np.abs(field.levels - levels[:, :some]).max() < 1e-6


@given(
    order=st.sampled_from([1.0, 1.3, 3.0]),
    light=st.floats(0, 1e4),
    first=st.sampled_from([0.0, 200.0]),
    second=st.sampled_from([0.3, 200.0]),
    start=st.floats(0, 1),
)
def test_two_steps_are_one(
    order: float, light: float, first: float, second: float, start: float
) -> None:
    """The equation is autonomous; and levels stay levels."""
    of = FieldParameters.checked([0.05], [[0.01]], [[1.0]], order)
    once, twice = (Field(of, 3, start) for _ in range(2))
    once.step([light], first + second)
    twice.step([light], first)
    twice.step([light], second)
    assert twice.levels == pytest.approx(once.levels, abs=2e-4)
    assert (once.levels >= 0).all()
    assert (once.levels <= 1).all()


def test_next_to_no_light_is_like_none() -> None:
    of = FieldParameters.checked([0.05], [[1.0]], [[1.0]], 3.0)
    for kappa in (0.0, 1e-32, 1e-25, 1e-12, 1e-8):
        field = Field(of, 2, [[0.0, 1.0]])
        field.step([kappa], 200.0)
        # r = (1 + (b − 1) k t)^(−1/(b − 1)) in the dark.
        np.testing.assert_allclose(field.levels[0], [200 * kappa, 21**-0.5], rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("order", [1.0, 1.4, 2.0])
def test_a_long_charge_ends_in_equilibrium(order: float) -> None:
    of = parameters((order,))
    light = light_of(0)
    long, at_once = Field(of, SAMPLES), Field(of, SAMPLES)
    for _ in range(30):
        long.step(light, 1000.0)
    at_once.charge_to_equilibrium(light)
    is_lit = light.any(axis=0)
    assert long.levels[:, is_lit] == pytest.approx(at_once.levels[:, is_lit], abs=2e-4)
    assert not at_once.levels[:, ~is_lit].any()


def test_light_that_is_even_needs_no_field() -> None:
    for texture in ({}, {"k_e": True}):
        of = parameters((1.0, 1.7), **texture)
        even, spread = Field(of, SAMPLES), Field(of, SAMPLES)
        light = np.linspace(0, 3, BANDS)
        even.step(light, 20.0)
        spread.step(np.repeat(light[:, None], SAMPLES, axis=1), 20.0)
        assert even.levels == pytest.approx(spread.levels, rel=1e-5)


def test_threads_and_chunks_have_no_seams() -> None:
    of = parameters((1.0, 2.0))
    n = 70_001
    rng = np.random.default_rng(5)
    light = rng.uniform(0, 5, (BANDS, n))
    field = Field(of, n)
    field.step(light, 7.0)
    for part in (slice(0, 3), slice(34_990, 35_010), slice(n - 3, n)):
        few = Field(of, len(light[0, part]))
        few.step(light[:, part], 7.0)
        assert field.levels[:, part] == pytest.approx(few.levels, rel=1e-6)


def test_captures_that_emit_at_once() -> None:
    of = FieldParameters.checked([0.05], [[0.02]], [[3.0]], 1.0, prompt=1.0)
    field = Field(of, 1, 0.5)
    assert field.radiance()[0, 0] == pytest.approx(3 * 0.05 * 0.5)
    assert field.radiance([4.0])[0, 0] == pytest.approx(3 * (0.05 * 0.5 + 0.08 * 0.5))


def test_eulers_error_falls_with_the_step_and_the_exact_one_has_none() -> None:
    of = parameters((1.0,))
    light = np.full(BANDS, 2.0)
    exact = Field(of, 1)
    exact.step(light, 8.0)
    errors = []
    for steps in (8, 32, 128):
        euler = Field(of, 1)
        for _ in range(steps):
            euler.step(light, 8.0 / steps, method="euler")
        errors.append(abs(float(euler.levels[0, 0] - exact.levels[0, 0])))
    assert errors[0] > 3 * errors[1] > 9 * errors[2] > 0


@pytest.mark.parametrize("name", ["blue-paint", "double-wide", "bottle"])
def test_measured_materials(name: str) -> None:
    """Those without excitation rates glow from the levels that they are given."""
    material = read_material(name)
    field = Field(FieldParameters.of(material), 2, 1.0)
    glow = field.radiance()[:, 0]
    states = [np.array(state.reradiation) * state.k_r_per_s for state in material.states]
    assert glow == pytest.approx(np.sum(states, axis=0), rel=1e-5)
    field.step(np.zeros(field.parameters.n_bands), 60.0)
    faded = [
        np.exp(-60 * state.k_r_per_s) * each
        for state, each in zip(material.states, states, strict=True)
    ]
    assert field.radiance()[:, 0] == pytest.approx(np.sum(faded, axis=0), rel=1e-4)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda: FieldParameters.checked([0.1], [[1.0, np.nan]], [[1.0]]), "k_e that are finite"),
        (lambda: FieldParameters.checked([-0.1], [[1.0]], [[1.0]]), "k_r that are finite"),
        (lambda: FieldParameters.checked([0.1], [[1.0]], [[1.0]], 0.5), "orders ≥ 1"),
        (lambda: FieldParameters.checked([0.1], [1.0], [[1.0]]), r"k_e of shape \(1, bands\)"),
        (lambda: FieldParameters.checked([[0.1, 0.2]], [[1.0]], [[1.0]], 2), "one k_r of a state"),
        (lambda: FieldParameters.checked([0.1], [[1.0]], [[1.0]], 1, 2.0), "prompt part"),
        (
            lambda: FieldParameters.checked([[0.1, 0.2]], [[[1.0] * 3]], [[1.0]]),
            "textures of one size",
        ),
        (lambda: FieldParameters.of(without_spectrum()), "re-radiation Λ"),
        (lambda: Field(parameters((1.0,)), 0), "number of samples"),
        (lambda: Field(parameters((1.0,)), 2, 1.5), "levels from 0 to 1"),
        (lambda: Field(parameters((1.0,)), 2, [[0.1, 0.2, 0.3]]), "levels of shape"),
        (lambda: Field(parameters((1.0,)), 2).step(np.zeros(3), 1.0), "irradiance of shape"),
        (lambda: Field(parameters((1.0,)), 2).step(-np.ones(BANDS), 1.0), "finite and ≥ 0"),
        (lambda: Field(parameters((1.0,)), 2).step(np.zeros(BANDS), -1.0), "duration ≥ 0"),
        (lambda: Field(parameters((1.0,)), 2).step(spoilt(np.nan), 1.0), "finite and ≥ 0"),
        (lambda: Field(parameters((2.0,)), 2).step(spoilt(np.inf), 1.0), "finite and ≥ 0"),
        (
            lambda: Field(parameters((2.0,)), 2).charge_to_equilibrium(spoilt(-1e3)),
            "finite and ≥ 0",
        ),
    ],
)
def test_what_does_not_fit_is_refused(wrong: Callable[[], object], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        wrong()


def test_many_short_steps_of_slow_materials_lose_no_digits() -> None:
    """Two minutes in the dark in steps of 10 ms: the same rounding in each would add up to 1e-4."""
    k_r = np.geomspace(0.003, 0.3, 16)
    parameters = FieldParameters.checked([k_r], [[0.0]], [[1.0]])
    level = np.linspace(0.1, 1, 16, dtype=np.float32)
    field = Field(parameters, levels=[level])
    for _ in range(12_000):
        field.step([0.0], 0.01)
    expected = level * np.exp(-parameters.k_r_per_s[0].astype(float) * 120)
    np.testing.assert_allclose(field.levels[0], expected, rtol=0, atol=2e-6)


def test_a_lit_level_stops_at_most_half_a_digit_of_a_step_before_its_end() -> None:
    parameters = FieldParameters.checked([0.01], [[1.0]], [[1.0]])
    field = Field(parameters, n_samples=8, levels=[np.linspace(0, 1, 8)])
    for _ in range(12_000):
        field.step([0.03], 0.1)
    assert np.abs(field.levels - 0.75).max() < 1.2 * 2**-25 / (0.04 * 0.1)
