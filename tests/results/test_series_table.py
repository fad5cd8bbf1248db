"""Anybody's table of a decay."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from labrig.errors import DataError, LabrigError, UsageError
from labrig.results import parse_series, read_series


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
    ("t,counts\n0,1\n1,nan\n", DataError, "line 3: expected a finite number for 'counts'"),
    ("t,counts\n0,1\n1e999,1\n", DataError, "line 3: expected a finite number for 't'"),
    ("t,counts\n0,1\n#\n1,many\n", UsageError, "line 4: .* got 'many'"),
    ("t,counts\n0,1_0\n", UsageError, "line 2: .* got '1_0'"),
    ("t;counts\n0;1,5\n", UsageError, "decimal point .* got '1,5'"),
    ("t,R,G\n0,1,2\n1,2,3\n2,,4\n", DataError, "line 4: expected a number for 'R', got nothing"),
    ("t,counts\n0,1\n1,2,3\n", UsageError, "line 3: expected 2 columns .* got 3"),
    ("t,R,G\n0,1,2\n1,2\n2,3,4\n", DataError, "line 3: expected a number for 'G'"),
    ("wl,counts\n420,1\n", UsageError, "a column t_s .* got wl, counts"),
    ("t,frame\n0,a\n", UsageError, "a column of values is missing"),
    ("t,time_s,R\n0,0,1\n", UsageError, "one of the columns t, time_s"),
    ("t,R,R\n0,1,1\n", UsageError, "a name of its own"),
    ("t,R,\n0,1,1\n1,1,1\n", UsageError, "a name of its own"),
    ("t,R,G,sigma\n0,1,1,1\n", UsageError, "for each of R, G"),
    ("1\n2\n", UsageError, "1 columns without names"),
    ("1,2,3,4\n", UsageError, "4 columns without names"),
    ("t,counts,sigma\n0,1,0\n", DataError, "sigma above 0"),
    ("t,exposure_s,counts\n0,-1,1\n", DataError, "negative"),
]


@pytest.mark.parametrize(("text", "kind", "why"), REFUSED)
def test_refused(text: str, kind: type[LabrigError], why: str) -> None:
    with pytest.raises(LabrigError, match=f"^x.csv: .*{why}") as refusal:
        parse_series(text, "x.csv")
    assert type(refusal.value) is kind
    assert "\n" not in str(refusal.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_series(tmp_path / "missing.csv")
    (tmp_path / "frame.cr2").write_bytes(bytes(range(256)))
    with pytest.raises(UsageError, match="UTF-8"):
        read_series(tmp_path / "frame.cr2")


@pytest.mark.shared_data
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
