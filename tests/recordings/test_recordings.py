"""Results of recorded runs stay what they were, until a commit says otherwise."""

import re
import shutil
from pathlib import Path

import pytest

from .numbers import differences
from .runs import RUNS, SLOW, Recorded


@pytest.mark.parametrize(
    "run",
    [
        pytest.param(run, id=run.name, marks=[pytest.mark.campaign] * (run.name in SLOW))
        for run in RUNS
    ],
)
def test_results_are_those_that_were_kept(run: Recorded, tmp_path: Path) -> None:
    result = run.processed(tmp_path)
    different = [str(one) for one in run.differences(result) if one.matters]
    assert not different, "\n".join(["python -m tests.recordings tells all", *different[:5]])
    assert as_a_program_writes((result / "report.html").read_text(encoding="utf-8")) == []


def as_a_program_writes(page: str) -> list[str]:
    """Tags, exponents and carets that a page shows, and numbers that stick to their %."""
    for hidden in (r"<(script|style|pre|code|svg)\b.*?</\1>", r"<[^>]*>"):
        page = re.sub(hidden, " ", page, flags=re.DOTALL)
    return re.findall(r".{0,25}(?:&lt;/?(?:su[bp]|[bi])\b|\d[eE][-+]?\d|\^|\d%).{0,15}", page)


def test_what_a_program_writes_is_noticed() -> None:
    plain = "<td>k<sub>r</sub> = 3 × 10<sup>−4</sup></td><code>1e-4 ^ 5%</code>"
    assert as_a_program_writes(plain) == []
    for odd in ("k&lt;sub>r", "3e-4", "t^2", "5% of"):
        assert len(as_a_program_writes(f"<td>{odd}</td>")) == 1


@pytest.mark.parametrize(
    ("file", "key", "factor"),
    [("fit.json", "k_r_per_s", 1 + 1e-6), ("material.yaml", "k_r_per_s_sigma", 1 + 1e-5)],
)
def test_a_small_change_of_a_rate_or_its_sigma_is_noticed(
    file: str, key: str, factor: float, tmp_path: Path
) -> None:
    kept = RUNS[0].folder / "result"
    planted = Path(shutil.copytree(kept, tmp_path / "result"))
    line = next(line for line in (kept / file).read_text().splitlines() if f"{key}" in line)
    number = line.split(":")[1].strip(" ,")
    text = (kept / file).read_text().replace(number, repr(float(number) * factor), 1)
    (planted / file).write_text(text)
    (found,) = differences(kept, planted)
    assert found.matters
    assert found.relative == pytest.approx(factor - 1, rel=0.01)
    assert not differences(kept, kept)


def test_numbers_on_one_side_are_differences(tmp_path: Path) -> None:
    kept = RUNS[0].folder / "result"
    without = Path(shutil.copytree(kept, tmp_path / "result"))
    (without / "series.csv").unlink()
    assert all(one.matters for one in differences(kept, without))
    assert all(one.matters for one in differences(without, kept))
    assert len(differences(kept, without)) == len(differences(without, kept)) > 100
