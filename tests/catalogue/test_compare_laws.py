"""Runs whose decay is no sum of exponentials are compared by the parameters of their law."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.catalogue import compare_runs
from labrig.results import FittedLaw, write_fitted_decay
from tests.results.made import decay_result


def run(folder: Path, tau_s: float, p: float, amplitude: float = 100.0, law: str = "") -> Path:
    """A run whose decay is Becquerel's, its rate and shape known to 2 %, negatively correlated."""
    rate, shape = p / tau_s, 1 / p
    sigma = np.array([amplitude, rate, shape, 1.0]) * [0.01, 0.02, 0.02, 0.1]
    correlation = np.eye(4)
    correlation[1, 2] = correlation[2, 1] = 0.9
    fitted = FittedLaw(
        "becquerel", amplitude, rate, shape, np.outer(sigma, sigma) * correlation, (1.0,), (0.0,),
        1.0, 100.0,
    )  # fmt: skip
    (folder / "result").mkdir(parents=True)
    (folder / "protocol.yaml").write_text("protocol: decay\nsample: {name: paint}\n")
    decay = replace(decay_result((0.1, 60.0), (0.01, 40.0)), law=law or "becquerel", laws=(fitted,))
    write_fitted_decay(folder / "result" / "fit.json", decay)
    return folder


def test_becquerel_decays_are_compared_by_tau_and_p(tmp_path: Path) -> None:
    a = run(tmp_path / "a", 80.0, 3.0)
    (same,) = compare_runs(a, run(tmp_path / "b", 81.0, 3.0, 101.0)).patches
    assert [d.quantity for d in same.differences] == ["τ", "exponent", "b", "a"]
    assert same.differences[0].a.value == pytest.approx(80.0)
    assert same.differences[1].b.value == pytest.approx(3.0)
    assert same.differences[3].pull == pytest.approx(1 / np.hypot(1.0, 1.01), rel=1e-3)
    assert "agree" in same.assessment
    # Each by 1.8 σ, but against their correlation.
    (apart,) = compare_runs(a, run(tmp_path / "c", 80.0 * 1.05 / 0.95, 3.0 / 0.95)).patches
    assert all(abs(d.pull) < 3 for d in apart.differences[:3])
    (shape,) = compare_runs(a, run(tmp_path / "d", 80.0 * 0.95 / 0.95, 3.0 * 0.95)).patches
    assert apart.p_value != shape.p_value
    (other,) = compare_runs(a, run(tmp_path / "e", 120.0, 3.0)).patches
    assert "differ" in other.assessment


def test_decays_by_different_laws_are_not_compared(tmp_path: Path) -> None:
    a, b = run(tmp_path / "a", 80.0, 3.0), run(tmp_path / "b", 80.0, 3.0, law="exponentials")
    (patch,) = compare_runs(a, b).patches
    assert patch.differences == ()
    assert "same --law" in patch.assessment
