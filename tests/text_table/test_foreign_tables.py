"""What instruments write is read right, or refused with what to say."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.results import read_described_series
from tests.foreign_tables import EXPORTS, Export, mutated, verdict


@pytest.mark.parametrize("export", EXPORTS, ids=lambda export: export.name)
def test_export(export: Export, tmp_path: Path) -> None:
    path = tmp_path / "export.txt"
    path.write_text(export.text, encoding="utf-8", newline="")
    how, said = verdict(path, export)
    assert how == ("refused" if export.refused else "right"), said
    assert export.refused in said
    assert "\n" not in said


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_however_it_is_written_it_is_read_right_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("table") / "mutated.txt"
    path.write_bytes(mutated(lambda options: data.draw(st.sampled_from(options))))
    how, said = verdict(path, Export("", ""))
    assert how != "wrong", said


def test_a_real_export_of_a_photon_counter() -> None:
    path = Path(__file__).parents[1] / "data" / "wrighttools" / "bh_spcm.asc"
    (series,), said = read_described_series(path)
    assert said.startswith("time Time[ns] (ns, from line 10 ")
    assert len(series.t_s) == 1024
    # Times are rounded to 1 fs.
    assert np.diff(series.t_s) == pytest.approx(3.2571e-12, abs=1.1e-15)


def test_a_logger_with_numbers_of_records(tmp_path: Path) -> None:
    path = tmp_path / "logger.dat"
    rows = "".join(f'"2026-11-28 10:00:{k:02}",{k},{90 - k}\n' for k in range(30))
    path.write_text(f'"TOA5","CR1000"\n"TIMESTAMP","RECORD","E"\n"TS","RN","lx"\n{rows}')
    (series,) = read_described_series(path)[0]
    assert series.channels == ("E",)
    assert series.t_s.tolist() == list(range(30))
