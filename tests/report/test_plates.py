"""Figures as files: as drawn, in vectors, the same bytes every time."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from labrig.report.decay_figures import linear_decay
from labrig.report.figure_style import CHANNEL, INK, figure_style
from labrig.report.page import FigureFiles

from .made import decay_series

pytestmark = pytest.mark.drawn

SVG = "{http://www.w3.org/2000/svg}"


def written(folder: Path) -> Path:
    series = decay_series()
    with figure_style(), FigureFiles("Öl & co") as figure_files:
        first = figure_files.add(linear_decay(series, None), "linear-1-Öl & co", "first")
        second = figure_files.add(linear_decay(series, None), "linear-2-Öl & co", "second")
    assert first.svg_link == "figures/linear-1-l-co.svg"
    assert first.pdf_link == "figures/figures.pdf#page=1"
    assert second.pdf_link == "figures/figures.pdf#page=2"
    folder.mkdir()
    figure_files.write(folder)
    return folder / "figures"


@pytest.fixture
def figures(tmp_path: Path) -> Path:
    return written(tmp_path / "one")


def test_an_svg_file_stands_alone(figures: Path) -> None:
    root = ElementTree.parse(figures / "linear-1-l-co.svg").getroot()
    assert (root.get("width"), root.get("height")) == ("420pt", "256pt")
    ground = root[0]
    assert (ground.tag, ground.get("fill")) == (f"{SVG}rect", "#ffffff")
    texts = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    assert "Time after lamp off / s" in texts
    text = (figures / "linear-1-l-co.svg").read_text(encoding="utf-8")
    # Programs other than browsers do not know variables.
    assert "var(--" not in text
    assert INK in text
    assert CHANNEL["G"] in text
    assert "DejaVu Sans" in text


def test_numbers_on_axes_keep_their_digits(figures: Path) -> None:
    series = decay_series()
    with figure_style(), FigureFiles("small") as figure_files:
        figure = linear_decay(series, None)
        figure.axes[0].set_ylabel("0.12345")
        figure_file = figure_files.add(figure, "a", "b")
    assert ">0.12345<" in figure_file.element
    assert not re.search(r'="[^"<>]*\d\.\d{3,}', figure_file.element)


def test_the_pdf_has_a_page_a_figure_and_fonts_that_publishers_take(figures: Path) -> None:
    content = (figures / "figures.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type /Page\b", content)) == 2
    assert b"/Type3" not in content
    assert b"CIDFontType2" in content
    assert b"CreationDate" not in content


def test_the_same_figures_give_the_same_bytes(figures: Path, tmp_path: Path) -> None:
    again = written(tmp_path / "two")
    assert {path.name: path.read_bytes() for path in again.iterdir()} == {
        path.name: path.read_bytes() for path in figures.iterdir()
    }
