"""Figures as files: as drawn, in vectors, the same bytes every time."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from labrig.report import Section, write_figures_pdf
from labrig.report.chart_figure import chart_figure
from labrig.report.decay_figures import linear_decay
from labrig.report.figure_files import FigureFiles
from labrig.report.figure_style import CHANNEL, INK
from labrig.report.sections import Picture

from .made import decay_series

pytestmark = pytest.mark.drawn

SVG = "{http://www.w3.org/2000/svg}"


CHART = linear_decay(decay_series(), None)
#: The same figure, drawn by labrig's own means and by matplotlib.
PICTURES = (Picture("chart", CHART), Picture("figure", lambda: chart_figure(CHART)))


def written(folder: Path) -> Path:
    figure_files = FigureFiles()
    for picture in PICTURES:
        figure_file = figure_files.add(picture, f"{picture.name}-Öl & co", "first")
        assert figure_file.link == f"figures/{picture.name}-l-co.svg"
    folder.mkdir()
    figure_files.write(folder)
    pdf = folder / "figures" / "figures.pdf"
    assert write_figures_pdf(pdf, "Öl & co", [Section("All", figures=PICTURES)]) == 2
    return pdf.parent


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("plates") / "one")


@pytest.mark.parametrize("name", [picture.name for picture in PICTURES])
def test_an_svg_file_stands_alone(figures: Path, name: str) -> None:
    root = ElementTree.parse(figures / f"{name}-l-co.svg").getroot()
    assert (root.get("width"), root.get("height")) == ("420pt", "256pt")
    ground = root[0]
    assert (ground.tag, ground.get("fill")) == (f"{SVG}rect", "#ffffff")
    texts = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    assert "Time after lamp off / s" in texts
    text = (figures / f"{name}-l-co.svg").read_text(encoding="utf-8")
    # Programs other than browsers do not know variables.
    assert "var(--" not in text
    assert INK in text
    assert CHANNEL["G"] in text
    assert "DejaVu Sans" in text


def test_numbers_on_axes_keep_their_digits() -> None:
    (panel,) = CHART.panels
    chart = replace(CHART, panels=(replace(panel, y=replace(panel.y, label="0.12345")),))
    for picture in (Picture("a", chart), Picture("a", lambda: chart_figure(chart))):
        element = FigureFiles().add(picture, "a", "b").element
        assert ">0.12345<" in element
        assert not re.search(r'="[^"<>]*\d\.\d{3,}', element)


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
