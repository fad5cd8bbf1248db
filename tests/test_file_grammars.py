"""Some files by a grammar that breaks its own rules; many more in the campaign."""

import random
from pathlib import Path

import pytest

from tests.acceptance.file_grammars import KINDS, Tally, try_one

CASES = 60


@pytest.mark.parametrize("kind", KINDS)
def test_a_broken_file_is_read_or_refused_in_a_line(kind: str, tmp_path: Path) -> None:
    tally = Tally()
    wrong = [try_one(kind, random.Random(case), tmp_path, tally) for case in range(CASES)]
    assert not any(wrong)
    assert tally.read > CASES // 10, "a grammar of which nothing is valid shows nothing"
    assert tally.refusals.total() > CASES // 10
