"""Glow that excites its own material in a closed room, against light that is followed."""

import numpy as np
import pytest

from labrig.material import self_excitation


def test_it_is_the_growth_of_light_that_is_followed_through_a_closed_room() -> None:
    """In rounds: what all states emit falls on them after all reflections, and is emitted again."""
    rng = np.random.default_rng(7)
    k_e, emitted = rng.uniform(0, 0.1, (3, 6)), rng.uniform(0, 1, (3, 6))
    albedo = rng.uniform(0, 0.9, 6)
    glow, before = rng.uniform(0, 1, 3), 1.0
    for _ in range(60):
        before = float(glow.sum())
        radiance, irradiance = glow @ emitted, np.zeros(6)
        for _ in range(400):
            irradiance = np.pi * radiance + albedo * irradiance
        glow = k_e @ irradiance
        grown, glow = float(glow.sum()) / before, glow / glow.sum() * before
    assert self_excitation(k_e, emitted, albedo) == pytest.approx(grown, rel=1e-9)


def test_of_samples_it_is_that_of_the_worst() -> None:
    k_e, emitted, albedo = [[0.1, 0.2]], [[0.5, 0.25]], [0.5, 0.2]
    once = self_excitation(k_e, emitted, albedo)
    each = np.array([0.3, 1.0, 0.7])
    assert self_excitation(k_e, np.multiply.outer(emitted, each), albedo) == pytest.approx(once)
    twice = np.multiply.outer(k_e, [1.0, 2.0, 0.5])
    darker = np.multiply.outer(albedo, [1.0, 0.0, 0.0])
    dark = self_excitation(2 * np.array(k_e), emitted, np.zeros(2))
    assert self_excitation(twice, emitted, darker) == pytest.approx(max(once, dark))
