"""What the journal of a run says of the whole run."""

import os
from pathlib import Path

import pytest

from labrig.record import RunRecord


@pytest.mark.parametrize(
    ("name", "text"), [(b"run-\xff", "run-\ufffd"), ("Prüfling".encode(), "Prüfling")]
)
def test_the_name_of_a_run_is_text(tmp_path: Path, name: bytes, text: str) -> None:
    folder = tmp_path / os.fsdecode(name)
    assert RunRecord(folder, [], False, 0.0).name == text
