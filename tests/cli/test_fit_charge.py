"""`labrig fit charge` on a table, and on tables and options that it cannot use."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.material import dark_concentration, lit_concentration
from tests.conftest import Ended

Labrig = Callable[..., Ended]
T_S = np.arange(0.0, 600.0, 3.0)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A state of order 1.7 that is charged from 30 s to 200 s."""
    lit_s, dark_s = np.clip(T_S - 30, 0, 170), np.maximum(T_S - 200, 0)
    charged = lit_concentration(0.0, 0.02, 0.05, 1.7, lit_s).value
    level = dark_concentration(charged, 0.05, 1.7, dark_s)
    light = 0.05 * level**1.7 + np.where(dark_s == 0, 0.02 * level, 0)
    counts = np.random.default_rng(4).poisson(1e5 * light)
    path = tmp_path / "charge.csv"
    np.savetxt(path, np.transpose([T_S, counts]), header="t_s,counts", delimiter=",", comments="")
    return path


def test_text_and_json_tell_the_order(labrig: Labrig, table: Path) -> None:
    command = ("fit", "charge", table, "--on", "30", "--off", "200", "--states", "1")
    ended = labrig(*command)
    assert ended.code == 0, ended.err
    assert "1 state of general order, after 170 s of charge" in ended.out
    fit = json.loads(labrig(*command, "--json").out)
    (state,) = fit["states"]
    assert state["order"]["value"] == pytest.approx(1.7, abs=4 * state["order"]["sigma"])
    assert state["kappa_per_s"]["value"] == pytest.approx(0.02, rel=0.2)
    assert fit["light_stimulated"] == {"value": 1.0, "sigma": 0.0}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--on", "30", "--off", "20"), "expected the lamp off after it was on at 30 s"),
        (("--on", "nan", "--off", "20"), "expected the lamp off after it was on"),
        (("--on", "30", "--off", "900"), "as many later, got"),
        (("--on", "30", "--off", "200", "--order", "third"), "--order: expected one of auto,"),
        (("--on", "30", "--off", "200", "--stimulated", "2"), "--stimulated: expected 'free' or"),
        (("--on", "30", "--off", "200", "--column", "light"), "light"),
    ],
)
def test_what_cannot_be_fitted_is_one_line(
    labrig: Labrig, table: Path, options: tuple[str, ...], said: str
) -> None:
    ended = labrig("fit", "charge", table, *options)
    assert ended.code != 0
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) == 1
