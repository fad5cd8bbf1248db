"""Anybody's table of a decay."""

from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.results import TableLayout, parse_series, read_series


@dataclass(frozen=True)
class Table:
    name: str
    text: str
    channels: tuple[str, ...] = ("counts",)
    sigma: float = np.nan


TABLES = [
    Table("csv", "t_s,counts\n0,10\n1,5\n"),
    Table("crlf, byte order mark, blanks", "\ufefft_s, counts\r\n0, 10\r\n1, 5\r\n\r\n"),
    Table("tsv", "time_s\tcounts\n0\t10\n1\t5"),
    Table("semicolons", "T;counts\n0;10\n1;5"),
    Table("blanks", "  t   counts\n  0.0   1e1\n  1.0   5\n"),
    Table("comments", "# by hand\nt,counts\n0,10\n# cloud\n1,5\n"),
    Table("no header", "0 10\n1 5\n", ("value",)),
    Table("no header, sigma", "0,10,0.5\n1,5,0.5\n", ("value",), 0.5),
    Table("one sigma", "t,counts,sigma\n0,10,0.5\n1,5,0.5\n", sigma=0.5),
    Table("named sigma", "t,counts,counts_sigma\n0,10,0.5\n1,5,0.5\n", sigma=0.5),
    Table("empty sigma", "t,counts,counts_sigma\n0,10,\n1,5,\n"),
    Table("settings in the first row", "t,counts,wl0,ref\n0,10,524,a.txt\n1,5,,\n"),
    Table("settings, short rows", "t\tcounts\tt0\tt1\n0\t10\t30\t330\n1\t5\n"),
    Table("trailing comma", "t,counts,\n0,10,\n1,5,\n"),
    Table("time is not first", "counts,t\n10,0\n5,1\n"),
    Table("units", "time / s;counts [a.u.]\n0;10\n1;5\n"),
    Table("minutes", "t (min)\tcounts\n0\t10\n0.016666666666666666\t5\n"),
    Table("milliseconds", "time_ms,counts\n0,10\n1000,5\n"),
    Table(
        "German", "Zeit in h;counts;Fehler\n0,0;10,0;0,5\n0,0002777777777777778;5;0,5\n", sigma=0.5
    ),
    Table("quoted decimal commas", '"t","counts"\n"0,0","10,0"\n"1,0","5"\n'),
    Table("error with a unit", "t,counts,Error (V)\n0,10,0.5\n1,5,0.5\n", sigma=0.5),
    Table("plus-minus", "t;counts;±\n0;10;0,5\n1;5;0,5\n", sigma=0.5),
    Table("σ of the name", "t counts σ_counts\n0 10 0.5\n1 5 0.5\n", sigma=0.5),
    Table("standard deviation", "t,counts,counts std\n0,10,0.5\n1,5,0.5\n", sigma=0.5),
    Table("preamble", "Counter: 7\nDate;1.11.2026\nGain;5\n\nTime [s];counts\n0;10\n1;5\n"),
    Table("line of units", "Time,counts\nms,V\n0,10\n1000,5\n"),
    Table("names in a comment", "# t counts\n0 10\n1 5\n"),
    Table("spaces in names", "Time (s)   counts (a.u.)\n0.0   10\n1.0   5\n"),
    Table("as NIST writes", "Data:   counts   x\n  10  0\n  5   1\n"),
    Table("numbered rows", ",t,counts\n0,0,10\n1,1,5\n"),
    Table("Excel's separator", "sep=;\nt;counts\n0;10\n1;5\n"),
    Table("old line ends", "t,counts\r0,10\r1,5\r"),
    Table("a minus sign of typesetters", "t,counts,dy\n\u22120,10,.5\n1,5,.5\n", sigma=0.5),
]


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)
def test_table(table: Table, tmp_path: Path) -> None:
    path = tmp_path / "decay.txt"
    path.write_text(table.text, encoding="utf-8", newline="")
    (series,) = read_series(path)
    assert series.channels == table.channels
    assert series.t_s.tolist() == [0, 1]
    assert series.values.tolist() == [[10], [5]]
    assert series.exposure_s.tolist() == [0, 0]
    assert np.array_equal(series.sigma, np.full((2, 1), table.sigma), equal_nan=True)
    assert np.isnan(series.dark_sigma).all()
    assert (series.region, series.unit) == ("", ("", ""))


def test_channels_regions_and_units_are_kept_apart() -> None:
    text = (
        "t_s,exposure_s,R,R_sigma,G,region,unit,flag\n"
        "0,1,1,.1,2,a,u1,\n0,1,3,.1,4,b,u1,clipped\n1,2,5,,6,a,u1,\n0,1,7,.1,8,a,u2,\n"
    )
    found = parse_series(text, "x")
    assert [(s.region, s.unit[0], s.values.tolist()) for s in found] == [
        ("a", "u1", [[1, 2], [5, 6]]),
        ("b", "u1", [[3, 4]]),
        ("a", "u2", [[7, 8]]),
    ]
    assert found[0].channels == ("R", "G")
    assert found[0].sigma[0, 0] == 0.1
    assert np.isnan(found[0].sigma[1, 0])
    assert np.isnan(found[0].sigma[:, 1]).all()
    assert found[0].exposure_s.tolist() == [1, 2]
    assert found[1].usable.tolist() == [False]


REFUSED: list[tuple[str, type[LabrigError], str]] = [
    ("", DataError, "no rows"),
    ("# nothing\n\n", DataError, "no rows"),
    ("t,counts\n", DataError, "a header without rows"),
    ("t,counts\n0,nan\n1,OL\n", UsageError, "got only 'nan'"),
    ("t,counts\n0,1\n1e999,1\n", UsageError, "line 3: expected a finite number for 't'"),
    ("t,counts\n0,1\n#\n1,many\n", UsageError, "line 4: .* got 'many'"),
    ("t,counts\n0,1_0\n", UsageError, "line 2: .* got '1_0'"),
    ("t;counts\n0;1,5\n1;many\n", UsageError, "line 3: .* decimal comma .* got 'many'"),
    ("t,R,G\n0,1,2\n1,2,3\n2,,4\n", UsageError, "line 4: expected a number for 'R', got nothing"),
    ("t,counts\n0,1\n1,2,3\n", UsageError, "line 3: expected 2 columns .* got 3"),
    ("t,R,G\n0,1,2\n1,2\n2,3,4\n", UsageError, "line 3: expected a number for 'G'"),
    ("wl,counts\n420,1\n", UsageError, "a column of times .* got wl, counts; .* '--time NAME'"),
    ("t,frame\n0,a\n", UsageError, "a column of values is missing"),
    ("t,time_s,R\n0,0,1\n", UsageError, "one of the columns t, time_s"),
    ("t,R,R\n0,1,1\n", UsageError, "a name of its own"),
    ("t,R,\n0,1,1\n1,1,1\n", UsageError, "a name for each of the 3 columns"),
    ("t,R,G,sigma\n0,1,1,1\n", UsageError, "for each of R, G"),
    ("1\n2\n", UsageError, "1 column without names"),
    ("t\tI\n1,234\t5,678\n", UsageError, "'1,234', .* thousands .* '--decimal comma'"),
    ("t,I\n0,5,1,25\n1,0,1,1\n", UsageError, "4 columns .* decimal commas between commas"),
    ("time (frames),I\n0,1\n1,2\n", UsageError, "unit of time .* '--time-unit s'"),
    ("t,A,B,±\n0,1,2,3\n1,2,3,4\n", UsageError, "each of A, B, .* '--column NAME'"),
    ("t,A,sigma,Error\n0,1,2,3\n", UsageError, "one column of uncertainties for 'A'"),
    ("t,counts,sigma\n0,1,0\n", DataError, "sigma above 0"),
    ("t,exposure_s,counts\n0,-1,1\n", DataError, "negative"),
]


def test_between_semicolons_the_comma_is_the_decimal_mark() -> None:
    (series,) = parse_series("t;I\n0;5,125\n1,500;2,250\n", "x.csv")
    assert series.t_s.tolist() == [0, 1.5]
    assert series.values[:, 0].tolist() == [5.125, 2.25]


@pytest.mark.parametrize(("text", "kind", "why"), REFUSED)
def test_refused(text: str, kind: type[LabrigError], why: str) -> None:
    with pytest.raises(LabrigError, match=f"^x.csv: .*{why}") as refusal:
        parse_series(text, "x.csv")
    assert type(refusal.value) is kind
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("encoding", "text"),
    [
        ("utf-8-sig", "t;I;±\n0;10;0,5\n1;5;0,5\n"),
        ("utf-16", "t\tI\t±\n0\t10\t0,5\n1\t5\t0,5\n"),
        ("cp1252", "t / µs;I;±\n0;10;0,5\n1000000;5;0,5\n"),
    ],
)
def test_encodings_of_excel_and_instruments(encoding: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "decay.txt").write_text(text, encoding=encoding)
    (series,) = read_series(tmp_path / "decay.txt")
    assert series.t_s == pytest.approx([0, 1])
    assert series.values.tolist() == [[10], [5]]
    assert series.sigma.tolist() == [[0.5], [0.5]]


def test_what_is_open_is_answered_by_the_layout() -> None:
    table = "wl\tA\t±\tB\t±\n1,500\t3,250\t0,100\t4,500\t0,200\n2,500\t1,250\t0,100\t2,500\t0,200\n"
    layout = TableLayout(time="wl", column="B", time_unit="ms", decimal="comma")
    (series,) = parse_series(table, "x", layout)
    assert series.channels == ("B",)
    assert series.t_s == pytest.approx([1.5e-3, 2.5e-3])
    assert series.values.tolist() == [[4.5], [2.5]]
    assert series.sigma.tolist() == [[0.2], [0.2]]
    with pytest.raises(UsageError, match=r"--time: expected one of .* got"):
        parse_series(table, "x", replace(layout, time="x"))
    with pytest.raises(UsageError, match=r"--column: expected one of .* got"):
        parse_series(table, "x", replace(layout, column="C"))
    with pytest.raises(UsageError, match="--block: expected a number from 1 to 1"):
        parse_series(table, "x", replace(layout, block=2))
    with pytest.raises(UsageError, match="--time-unit: expected"):
        TableLayout(time_unit="mile")
    with pytest.raises(UsageError, match="--decimal: expected"):
        TableLayout(decimal=";")


@pytest.mark.parametrize("width", ["0.4", "0 ns", "0.4 nm", "1,000 ns", "-1 ns"])
def test_a_width_of_a_channel_that_is_none_is_refused(width: str) -> None:
    with pytest.raises(UsageError, match="--time-per-channel: expected"):
        TableLayout(time_per_channel=width)


def test_each_column_of_values_has_the_uncertainty_right_of_it() -> None:
    (series,) = parse_series("t;A;±;B;±\n0;1;0,1;2;0,2\n1;1;0,3;2;0,4\n", "x")
    assert series.channels == ("A", "B")
    assert series.sigma.tolist() == [[0.1, 0.2], [0.3, 0.4]]


_finite = st.floats(min_value=-1e36, max_value=1e36)
#: As seconds, these need no unit.
_times = st.floats(min_value=-1e10, max_value=1e10)


@settings(max_examples=30, deadline=None)
@given(
    rows=st.lists(
        st.tuples(_times, _finite, st.floats(min_value=1e-300, max_value=1e36)),
        min_size=2,
        max_size=6,
        unique_by=lambda row: row[0],
    ).map(sorted),
    delimiter=st.sampled_from([";", "\t", "; ", " ", "   "]),
    comma=st.booleans(),
    unit=st.sampled_from(["", " (s)", " [s]", "/s"]),
    name=st.sampled_from(["Error", "±", "σ", "sigma", "std", "uncertainty", "err", "signal_err"]),
    head=st.sampled_from(["", "# made by a script\n", "Instrument: XY-3\n\n"]),
    line_end=st.sampled_from(["\n", "\r\n"]),
)
def test_any_style_reads_back_the_same_numbers(
    rows: list[tuple[float, float, float]],
    delimiter: str,
    comma: bool,
    unit: str,
    name: str,
    head: str,
    line_end: str,
) -> None:
    cells = [[f"{number:.17e}" for number in row] for row in rows]
    if comma:
        cells = [[cell.replace(".", ",") for cell in row] for row in cells]
    lines = [delimiter.join((f"time{unit}", "signal", name)), *map(delimiter.join, cells)]
    (series,) = parse_series(line_end.join([*head.splitlines(), *lines]), "x")
    read = np.column_stack([series.t_s, series.values, series.sigma])
    zero_s = series.clock.zero_s
    assert read.tolist() == [[float(Decimal(f"{t:.17e}") - zero_s), *others] for t, *others in rows]
    assert series.channels == ("signal",)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_series(tmp_path / "missing.csv")
    (tmp_path / "frame.cr2").write_bytes(bytes(range(256)))
    with pytest.raises(UsageError, match="UTF-8"):
        read_series(tmp_path / "frame.cr2")
    (tmp_path / "decay.xlsx").write_bytes(b"PK\x03\x04" + bytes(20))
    with pytest.raises(UsageError, match=r"a workbook.*CSV"):
        read_series(tmp_path / "decay.xlsx")


def test_a_real_decay_in_somebodys_table(shared_data: Path) -> None:
    folder = shared_data / "decay" / "perslqy_sao"
    (series,) = read_series(folder / "sample_400_524_300s.txt")
    assert series.channels == ("counts",)
    assert len(series.t_s) == len(series.values) > 6500
    assert (series.t_s[0], series.values[0, 0]) == (0, 4.34409618)
    assert np.diff(series.t_s) == pytest.approx(0.6)
    for name in ("sample_400_400_300s.txt", "ref_400_400.txt"):
        assert read_series(folder / name)[0].channels == ("counts",)
    luminescence = shared_data / "decay" / "cran_luminescence"
    for path in sorted(luminescence.glob("*.csv")):
        assert read_series(path)[0].channels == ("counts",)


@pytest.mark.parametrize(
    ("header", "sigma"),
    [
        ("t / s,I / V,σ / mV", [0.001, 0.001]),
        ("t / s,I (mV),I_sigma (µV)", [0.001, 0.001]),
        ("t,I / V,Error (%)", [0.1, 0.05]),
        ("t,I / %,Error (%)", [1.0, 1.0]),
        ("t,I / V,σ(I)", [1.0, 1.0]),
        ("t,I [mcd/m²],± [cd/m^2]", [1000.0, 1000.0]),
        ("t,I,σ\ns,V,mV", [0.001, 0.001]),
    ],
)
def test_sigma_comes_in_the_unit_of_the_values(header: str, sigma: list[float]) -> None:
    (series,) = parse_series(f"{header}\n0,10,1\n1,5,1\n", "table")
    assert series.sigma[:, 0] == pytest.approx(sigma)


@pytest.mark.parametrize("unit", ["A", "MV/s", "counts"])
def test_sigma_in_a_unit_of_another_quantity_is_refused_with_both_units(unit: str) -> None:
    with pytest.raises(UsageError, match=f"'mV'.*'{unit}'"):
        parse_series(f"t,I / mV,Error / {unit}\n0,10,1\n1,5,1\n", "table")


@pytest.mark.parametrize(
    ("head", "lines", "cell"),
    [
        ("t,I\n0,OVER\n1,OVER\n", "lines 2 to 3", "OVER"),
        ("t,I,note\n0,OVER,a\n1,O.L,b\n", "line 2", "OVER"),
        ("Gain,5\n\nI,t\nOVER,0\n9,1\n", "line 4", "OVER"),
        ("t,I\ns,V\n0,-\n", "line 3", "-"),
        ("# cloud\n0,OVER\n", "line 2", "OVER"),
        ("t / s   I / V\n0  OVER\n", "line 2", "OVER"),
    ],
)
def test_rows_without_a_value_at_the_head_are_left_out_with_their_line(
    head: str, lines: str, cell: str
) -> None:
    rows = "".join(f"{9 - k},{k}\n" if "I,t" in head else f"{k},{9 - k}\n" for k in range(2, 8))
    text = head + (rows if "," in head else rows.replace(",", " "))
    (series,) = parse_series(text, "x")
    assert series.values[-6:, 0].tolist() == [7, 6, 5, 4, 3, 2]
    assert series.t_s[-6:].tolist() == [2, 3, 4, 5, 6, 7]
    warning = series.warnings[0]
    assert (warning.code, warning.subject) == ("row-without-value", lines)
    assert warning.values["cell"] == cell
    with pytest.raises(UsageError, match=r"^x: line \d: .* 'much'"):
        parse_series(text.replace("OVER", "much").replace("0,-", "0,much"), "x")


@pytest.mark.parametrize(
    ("clock", "t_s"),
    [
        (["12:00:05", "12:00:06.5", "12:01:05"], [0, 1.5, 60]),
        (["23:59:58", "0:00:01", "00:01:00"], [0, 3, 62]),
        (["2026-11-01 23:00:00", "2026-11-02 00:00:00", "2026-11-03T00:00:00"], [0, 3600, 90000]),
    ],
)
@pytest.mark.parametrize("columns", [1, 2])
def test_times_of_day_are_counted_from_the_first_row(
    clock: list[str], t_s: list[float], columns: int
) -> None:
    rows = [f"{time};{';'.join(['5'] * columns)}" for time in clock]
    (series,) = parse_series("\n".join([f"time;{';'.join('AB'[:columns])}", *rows]), "x")
    assert series.t_s.tolist() == t_s
    assert series.values.tolist() == [[5] * columns] * 3


@pytest.mark.parametrize("time", ["12:05", "25 h", "2026-11-01 12:00:01"])
def test_times_of_day_of_several_kinds_are_refused(time: str) -> None:
    with pytest.raises(UsageError, match=r"line [23]: expected (a time|times in one form)"):
        parse_series(f"time;A\n12:00:00;1\n{time};1\n12:00:02;1\n", "x")


def test_a_run_folder_is_answered_with_its_series(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected a table, got a folder"):
        read_series(tmp_path)
    (tmp_path / "result").mkdir()
    for name in ("protocol.yaml", "rig.yaml", "result/series.csv"):
        (tmp_path / name).touch()
    with pytest.raises(UsageError, match=r"result.series\.csv"):
        read_series(tmp_path)
