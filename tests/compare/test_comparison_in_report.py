"""A comparison in the report of its run: as long as it is of the report's own result."""

from pathlib import Path

import pytest

from labrig.process import show_comparison
from labrig.process.comparison import include_comparison
from labrig.record import RunDescription
from labrig.report import Report, Section, write_report

COMPARED = Section("Compared", text=("They < agree.",))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "result.json").write_text("{}")
    about = RunDescription(
        title="paint", protocol="decay", run="of-today", started="", ended="", rig="",
        simulated=False, labrig_version="0.1.0",
    )  # fmt: skip
    sections = (Section("Results", text=("Some.",)),)
    write_report(tmp_path / "result" / "report.html", Report(about, sections=sections))
    return tmp_path


def page(run: Path) -> str:
    return (run / "result" / "report.html").read_text(encoding="utf-8")


def test_it_stands_after_the_sections_and_once(run: Path) -> None:
    before = page(run)
    assert include_comparison(run, run / "result")
    assert page(run) == before
    for _ in range(2):
        assert show_comparison(run, (COMPARED,))
        assert page(run).count("They &lt; agree.") == 1
    assert page(run).index("Some.") < page(run).index("agree.") < page(run).index("Provenance")


def test_one_of_another_result_is_not_shown_but_named(run: Path) -> None:
    show_comparison(run, (COMPARED,))
    (run / "result" / "result.json").write_text('{"k": 1}')
    assert include_comparison(run, run / "result")
    assert "agree." not in page(run)
    assert f"labrig reproduce {run.name} --rendered" in page(run)


def test_a_page_without_a_place_for_it_stays_as_it_is(run: Path) -> None:
    (run / "result" / "report.html").write_text("<p>an earlier one</p>")
    assert not show_comparison(run, (COMPARED,))
    assert page(run) == "<p>an earlier one</p>"
