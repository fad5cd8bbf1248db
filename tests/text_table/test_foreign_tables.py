"""What instruments write is read right, or refused with what to say."""

from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

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
