"""Tables as they are written: texts that a spreadsheet would run are none, and read back."""

import ast
import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

import labrig
from labrig.material import ReradiationMatrix, read_reradiation, write_reradiation
from labrig.optics import SpectrometerReading, Spectrum, read_spectrometer_reading
from labrig.results import Series, write_series
from labrig.text_table import cell_text, plain_text, table_text

HOME = Path(__file__).parents[2]
FORMULA = tuple("=+-@\t\r＝＋－＠")
PLANTED = '=HYPERLINK("http://a.b")'
TEXTS = st.text(st.sampled_from("=+-@\t\r\n',;|\" a1.einf＝"), max_size=12)


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def cells(text: str, separator: str) -> Iterator[str]:
    for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator):
        yield from row


@given(TEXTS)
@example("'=1")
@example("\t=1")
def test_a_text_is_read_back_unchanged(text: str) -> None:
    assert plain_text(cell_text(text)) == text


@given(TEXTS, TEXTS)
@example("a;=1;", "")
@example('";@1', "-1+2")
def test_no_cell_begins_a_formula_wherever_a_spreadsheet_divides_it(one: str, other: str) -> None:
    written = table_text(["name", "other"], [[one, other]])
    for separator in ",;\t|":
        for cell in cells(written, separator):
            # Divided elsewhere, a cell may be several, of which a number may be the first.
            assert not cell.startswith(FORMULA) or is_number(cell.partition(",")[0]), cell


@given(st.floats())
def test_a_number_stays_a_number(number: float) -> None:
    *_, cell = cells(table_text(["value"], [[f"{number:.6g}"]]), ",")
    assert cell == f"{number:.6g}"


def test_names_in_a_series_are_read_back(tmp_path: Path) -> None:
    series = Series(
        t_s=np.array([1.0, 2.0]),
        exposure_s=np.array([0.5, 0.5]),
        values=np.array([[-0.5], [0.25]]),
        sigma=np.array([[0.1], [0.1]]),
        dark_sigma=np.array([np.nan]),
        channels=("@G",),
        iso=np.array([400.0, 400.0]),
        f_number=np.array([4.0, 4.0]),
        frame=("000001.dng", "000002.dng"),
        unit=("-x", "-x"),
        flag=("+late", ""),
        region=PLANTED,
    )
    path = tmp_path / "series.csv"
    write_series(path, [series])
    for cell in cells(path.read_text(), ","):
        assert not cell.startswith(FORMULA) or is_number(cell)
    (read,) = labrig.read_series(path)
    assert (read.region, read.channels, read.unit, read.flag) == (
        series.region, series.channels, series.unit, series.flag
    )  # fmt: skip
    assert np.array_equal(read.values, series.values)


@pytest.mark.parametrize("name", [PLANTED, "paper,=1+1", "paper;@SUM(1)", "'=1"])
def test_the_name_of_a_matrix_is_read_back(tmp_path: Path, name: str) -> None:
    bands = np.array([400.0, 450.0])
    matrix = ReradiationMatrix(name, bands, bands, np.array([0.5, 0.5]), np.zeros((2, 2)))
    write_reradiation(tmp_path / "paper.csv", matrix)
    comment = (tmp_path / "paper.csv").read_text().splitlines()[0]
    assert not any(cell.startswith(FORMULA) for mark in ",;" for cell in comment.split(mark))
    assert read_reradiation(tmp_path / "paper.csv").name == name


def test_the_name_of_a_calibration_in_a_reading_is_read_back(tmp_path: Path) -> None:
    grid_nm = np.array([400.0, 500.0])
    lamp = Spectrum("lamp,=1+1;@x", grid_nm, np.ones(2))
    reading = SpectrometerReading(grid_nm, np.ones((1, 2)), 0.1, 1e4, calibration=lamp)
    path = tmp_path / "000001.csv"
    path.write_text(reading.text())
    for mark in ",;":
        assert not any(cell.startswith(FORMULA) for cell in reading.text().split(mark))
    calibration = read_spectrometer_reading(path).calibration
    assert calibration is not None
    assert calibration.name == lamp.name


def test_tables_are_written_in_one_place() -> None:
    """A new writer would write texts as they are."""
    writers = {"writer", "DictWriter", "savetxt", "to_csv"}
    call = re.compile(rf"\.({'|'.join(writers)})\(")
    used = [
        str(path.relative_to(HOME))
        for folder in ("labrig", "drivers", "protocols", "sim")
        for path in sorted((HOME / folder).rglob("*.py"))
        if call.search(source := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute) and node.attr in writers
    ]
    assert used == ["labrig/text_table/written_table.py"]
