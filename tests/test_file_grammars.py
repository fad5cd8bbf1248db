"""Some files by a grammar that breaks its own rules; many more in the campaign."""

import random
from pathlib import Path

import pytest

from labrig.foundation.errors import LabrigError
from labrig.material import read_reradiation
from tests.acceptance.file_grammars import KINDS, Tally, ark, try_one

CASES = 60


@pytest.mark.parametrize("kind", KINDS)
def test_a_broken_file_is_read_or_refused_in_a_line(kind: str, tmp_path: Path) -> None:
    tally = Tally()
    wrong = [try_one(kind, random.Random(case), tmp_path, tally) for case in range(CASES)]
    assert not any(wrong)
    assert tally.read > CASES // 10, "a grammar of which nothing is valid shows nothing"
    assert tally.refusals.total() > CASES // 10


@pytest.mark.filterwarnings("error")
def test_a_scale_beyond_all_floats_is_refused_and_no_warning(tmp_path: Path) -> None:
    path = tmp_path / "file.ark"
    path.write_bytes(ark(random.Random(1)).replace(b"value: 1.0", b"value: 1e-310"))
    with pytest.raises(LabrigError, match="inf"):
        read_reradiation(path)
