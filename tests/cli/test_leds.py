"""`labrig leds study`: sets of LEDs compared, told and drawn; bad input in one line."""

import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from labrig.fit.fluorescence import RECOMMENDED_NM, LedSet, LedStudy, moved_leds
from labrig.material import write_reradiation
from labrig.report import ComparedLeds, describe_leds, led_study_report
from labrig.report.chart import Chart, Points
from tests.conftest import Ended
from tests.material.reradiation.synthetic import YELLOW, measurement
from tests.report.about import ABOUT

Labrig = Callable[..., Ended]


def made_set(placement: str, peaks_nm: Sequence[float], error: float) -> LedSet:
    study = LedStudy(("felt",), ("D65", "A"), np.array([[error, 2 * error]]))
    return LedSet(placement, tuple(peaks_nm), study)


def test_own_leds_are_judged_beside_even_ones(labrig: Labrig, tmp_path: Path) -> None:
    write_reradiation(tmp_path / "felt.csv", measurement(5, YELLOW).measured)
    ended = labrig(
        "leds", "study", tmp_path / "felt.csv", "--number", "5", "--leds", "405 450 490 530 600",
        "--light", "D65", "--out", tmp_path / "page", "--json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    told = json.loads(ended.out)
    assert [one["placement"] for one in told["sets"]] == ["even", "given"]
    assert told["sets"][1]["peaks_nm"] == [405, 450, 490, 530, 600]
    assert all(0 < one["median"][0] < 10 for one in told["sets"])
    assert json.loads((tmp_path / "page/led_study.json").read_text()) == told
    assert "--number 5" in (tmp_path / "page/report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--number", "six"], "--number"),
        (["--number", "6.5"], "whole numbers"),
        (["--number", "99"], "3 to 24 LEDs"),
        (["--number", "3", "--leds", "200 300 400"], "350 nm"),
        (["--number", "3", "--leds", "blue"], "--leds"),
        (["nowhere.csv"], "nowhere.csv"),
        (["."], "no such file"),
        (["--camera", "canvas"], "canvas"),
    ],
)
def test_bad_input_is_answered_in_one_line(
    labrig: Labrig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = labrig("leds", "study", *arguments)
    assert ended.code == 2
    assert told in ended.err
    assert len([line for line in ended.err.splitlines() if not line.startswith("note")]) == 1


def test_a_search_finds_better_leds_and_leaves_them_apart() -> None:
    best = np.array([380, 450, 460, 600])

    def study(peaks_nm: Sequence[float]) -> LedSet:
        return made_set("found", peaks_nm, float(np.abs(np.sort(peaks_nm) - best).sum()) + 0.1)

    tried = list(moved_leds(study((400, 450, 470, 600)), study, sweeps=5))
    assert tried[-1].peaks_nm == tuple(best)
    assert all(later.judged <= one.judged for one, later in pairwise(tried))
    assert all(len(set(one.peaks_nm)) == 4 for one in tried)


def test_the_page_shows_every_set_where_it_is() -> None:
    sets = [made_set("recommended", RECOMMENDED_NM[count], 3 / count) for count in (6, 9, 12)]
    sets.append(made_set("given", (400, 500, 600), 2.0))
    compared = ComparedLeds(tuple(sets), "camera", "1 felt")
    for_numbers, for_places = led_study_report(compared, ABOUT).sections
    (error,), (placement,) = for_numbers.figures, for_places.figures
    assert isinstance(error.drawing, Chart)
    assert isinstance(placement.drawing, Chart)
    points = [mark for mark in error.drawing.panels[0].marks if isinstance(mark, Points)]
    assert points[0].x.tolist() == [6, 9, 12]
    assert points[0].y == pytest.approx([0.5, 1 / 3, 0.25])
    rows = [mark for mark in placement.drawing.panels[0].marks if isinstance(mark, Points)]
    assert [tuple(mark.x) for mark in reversed(rows)] == [one.peaks_nm for one in sets]
    assert "3     given        2.00, 2.00" in describe_leds(compared)
