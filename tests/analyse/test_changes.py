"""What is said of two results, and where the older one goes."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig.process.result_changes import changes
from labrig.process.run import new_result, put_in_place
from labrig.results import FittedDecay, write_fitted_decay
from tests.quick_yaml import write_quickly
from tests.results.made import decay_result as fit

Put = Callable[..., Path]

MADE_WITH = {"labrig": "0.1.0", "libraries": {"numpy": "2.0.0"}, "excluded": []}


@pytest.fixture
def put(tmp_path: Path) -> Put:
    def write(
        name: str, fit: FittedDecay | None = None, patch: str = ".", made_with: Any = MADE_WITH
    ) -> Path:
        folder = tmp_path / name
        (folder / patch).mkdir(parents=True, exist_ok=True)
        if made_with:
            (folder / "provenance.yaml").write_text(write_quickly(made_with))
        if fit:
            write_fitted_decay(folder / patch / "fit.json", fit)
        return folder

    return write


def test_equal_results(put: Put) -> None:
    old, new = put("old", fit((0.03, 800.0))), put("new", fit((0.03, 800.0)))
    (old / "notes.txt").write_text("a person's own")
    assert changes(old, new) == ()


def test_moves_are_reported_in_sigma(put: Put) -> None:
    made_with = MADE_WITH | {"labrig": "0.2.0", "libraries": {"numpy": "2.1.0"}}
    old = put("old", fit((0.03, 800.0)))
    new = put("new", fit((0.0306, 800.0), offset=0.002), made_with=made_with)
    assert changes(old, new) == (
        "labrig: 0.1.0 → 0.2.0",
        "libraries numpy: 2.0.0 → 2.1.0",
        "k_r 1 0.03000 ± 0.00030 → 0.03060 ± 0.00031 (+2 σ); offset G by at most 2 σ",
    )


def test_rounding_is_not_told_number_by_number(put: Put) -> None:
    old, new = put("old", fit((0.03, 800.0))), put("new", fit((0.03000001, 800.0)))
    (numbers, why) = changes(old, new)
    assert numbers == "every parameter within 0.01 σ"
    assert "nothing that is recorded explains it" in why


def test_another_number_of_states(put: Put) -> None:
    old = put("old", fit((0.03, 800.0)), "left")
    new = put("new", fit((0.1, 90.0), (0.03, 700.0)), "left", MADE_WITH | {"states": 2})
    settings, numbers = changes(old, new)
    assert settings == "states: none → 2"
    assert numbers == (
        "left: 1 state (k_r 0.03000 ± 0.00030 1/s) → "
        "2 states (k_r 0.1000 ± 0.0010, 0.03000 ± 0.00030 1/s)"
    )


def test_fits_that_come_and_go(put: Put) -> None:
    old, new = put("old", fit((0.03, 8.0)), "left"), put("new", fit((0.03, 8.0)), "right")
    assert changes(old, new)[:2] == ("left: fitted before, not now", "right: not fitted before")


def test_a_result_that_says_nothing_of_itself(put: Put) -> None:
    old, new = put("old", made_with=None), put("new")
    (old / "fit.json").write_text("rubbish")
    assert changes(old, new) == (
        "the libraries of the earlier result are not recorded",
        "the numbers are the same; other in provenance.yaml",
    )


def test_numbers_that_are_no_decay_are_compared_too(put: Put) -> None:
    old, new = put("old", fit((0.03, 800.0))), put("new", fit((0.03, 800.0)))
    for folder, lightness in ((old, 91.5), (new, 96.1)):
        content = {"patches": {"paper": {"lab": [lightness, 1.0, 2.0], "leds": ["430 nm"]}}}
        (folder / "result.json").write_text(json.dumps(content))
    assert changes(old, new)[0] == ("1 of 3 numbers differ, most patches paper lab 1: 91.5 → 96.1")


def test_earlier_results_are_numbered_from_old_to_new(tmp_path: Path) -> None:
    def process(text: str) -> tuple[str, ...]:
        made = new_result(tmp_path)
        (made / "series.csv").write_text(text)
        return put_in_place(made)

    def kept() -> dict[str, str]:
        return {path.parent.name: path.read_text() for path in tmp_path.glob("*/series.csv")}

    (tmp_path / "result.part").mkdir()
    (tmp_path / "result.part" / "of a crash").touch()
    assert process("a") == ()
    assert process("a") == ("the same result as before",)
    assert "result-1" in process("b")[0]
    assert "result-2" in process("c")[0]
    assert kept() == {"result-1": "a", "result-2": "b", "result": "c"}
    (tmp_path / "result-1" / "series.csv").unlink()
    (tmp_path / "result-1").rmdir()
    assert "result-3" in process("d")[0], "later still counts as later"
    assert [path.name for path in (tmp_path / "result").iterdir()] == ["series.csv"]
