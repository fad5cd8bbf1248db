"""`labrig fit charge` on a table, and on tables and options that it cannot use."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.material import dark_concentration, lit_concentration, read_material
from tests.conftest import Ended

Labrig = Callable[..., Ended]
T_S = np.arange(0.0, 600.0, 3.0)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A state of order 1.7 that is charged from 30 s to 200 s."""
    lit_s, dark_s = np.clip(T_S - 30, 0, 170), np.maximum(T_S - 200, 0)
    charged = lit_concentration(0.0, 0.02, 0.05, 1.7, lit_s)
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


def test_intervals_of_the_order_are_printed_and_on_the_page(
    labrig: Labrig, table: Path, tmp_path: Path
) -> None:
    command = ("fit", "charge", table, "--on", "30", "--off", "200", "--states", "1")
    ended = labrig(*command, "--intervals", "--out", tmp_path / "made")
    assert ended.code == 0, ended.err
    assert "b 1 " in ended.out
    fit = json.loads((tmp_path / "made" / "result" / "fit.json").read_text(encoding="utf-8"))
    low, high = fit["intervals"]["order 1"]["interval_95"]
    assert low < 1.7 < high
    page = (tmp_path / "made" / "result" / "report.html").read_text(encoding="utf-8")
    assert "profile likelihood" in page


def test_an_order_at_its_bound_has_a_limit_in_every_file(labrig: Labrig, tmp_path: Path) -> None:
    """A state of first order, whose fitted order is 1 or just above as the noise has it."""
    lit_s, dark_s = np.clip(T_S - 30, 0, 170), np.maximum(T_S - 200, 0)
    level = lit_concentration(0.0, 0.02, 0.015, 1.0, lit_s) * np.exp(-0.015 * dark_s)
    light = 0.015 * level + np.where(dark_s == 0, 0.02 * level, 0)
    held = []
    for seed in range(4):
        counts = np.random.default_rng(100 + seed).poisson(1e6 * light)
        path, made = tmp_path / f"{seed}.csv", tmp_path / f"{seed}" / "result"
        np.savetxt(
            path, np.transpose([T_S, counts]), header="t_s,counts", delimiter=",", comments=""
        )
        command = ("fit", "charge", path, "--on", "30", "--off", "200", "--states", "1")
        ended = labrig(*command, "--order", "general", "--out", made.parent)
        assert ended.code == 0, ended.err
        (fitted,) = json.loads((made / "fit.json").read_text(encoding="utf-8"))["states"]
        (state,) = read_material(made / "material.yaml").states
        limit = fitted["order"].get("limit_95")
        held.append(limit is not None)
        assert state.kinetic_order == fitted["order"]["value"]
        assert state.kinetic_order_limit_95 == limit
        if limit is not None:
            assert state.kinetic_order == 1
            assert 1 < limit < 1.1
            text = f"< {limit:.4f}"[:5]
            assert text in ended.out
            assert text in labrig("material", "show", made / "material.yaml").out
            assert text in (made / "report.html").read_text(encoding="utf-8").replace("&lt;", "<")
    assert 0 < sum(held) < len(held)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--on", "30", "--off", "20"), "expected the lamp off after it was on at 30 s"),
        (("--on", "nan", "--off", "20"), "--on: expected a time such as"),
        (("--on", "9030", "--off", "9200"), "whose rows are from"),
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


def test_out_has_page_files_and_material(labrig: Labrig, table: Path, tmp_path: Path) -> None:
    options = ("--on", "30", "--off", "200", "--states", "1")
    out = tmp_path / "glow"
    ended = labrig("fit", "charge", table, *options, "--out", out)
    assert ended.code == 0, ended.err
    result = out / "result"
    fit = json.loads((result / "fit.json").read_text(encoding="utf-8"))
    assert (fit["kind"], fit["schema_version"]) == ("charge", 1)
    (state,) = fit["states"]
    (known,) = read_material(result / "material.yaml").states
    assert known.kinetic_order == state["order"]["value"]
    assert known.r0 == state["r0"]["value"]
    assert known.r0 is not None
    # a = Λ k_r r(0)ᵇ
    assert known.r0 is not None
    made = state["reradiation"]["value"] * known.k_r_per_s * known.r0**known.kinetic_order
    assert known.amplitude == pytest.approx(made, rel=1e-6)
    readings = np.genfromtxt(result / "readings.csv", delimiter=",", skip_header=1)
    off = (readings[:, 1] - readings[:, 3]) / readings[:, 2]
    lit = readings[:, 0] < 170
    assert np.mean(off[lit] ** 2) == pytest.approx(fit["chi2_charge"], rel=1e-4)
    assert np.mean(off[~lit] ** 2) == pytest.approx(fit["chi2_decay"], rel=1e-4)
    page = (result / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") >= 2
    assert "1 state of general order" in page
    again = labrig("fit", "charge", table, *options, "--out", out)
    assert "the same result as before" in again.out
    other = labrig("fit", "charge", table, *options, "--order", "first", "--out", out)
    assert "; p/τ 1 " in other.out
    assert (out / "result-1").is_dir()


def test_without_saturation_there_is_no_material(labrig: Labrig, tmp_path: Path) -> None:
    """A charge that stays straight tells k_r and r(0) of a general order only together."""
    lit_s, dark_s = np.clip(T_S - 30, 0, 170), np.maximum(T_S - 200, 0)
    charged = lit_concentration(0.0, 1e-5, 40.0, 2.0, lit_s)
    level = dark_concentration(charged, 40.0, 2.0, dark_s)
    light = 1e10 * (40.0 * level**2 + np.where(dark_s == 0, 1e-5 * level, 0))
    table, out = tmp_path / "weak.csv", tmp_path / "weak"
    counts = np.random.default_rng(5).poisson(light)
    np.savetxt(table, np.transpose([T_S, counts]), header="t_s counts", comments="")
    ended = labrig(
        "fit", "charge", table, "--on", "30", "--off", "200", "--states", "1", "--order",
        "general", "--out", out,
    )  # fmt: skip
    assert ended.code == 0, ended.err
    assert "no material file" in ended.out
    assert not (out / "result" / "material.yaml").exists()
