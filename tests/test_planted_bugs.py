"""The planted bugs are where the code is: code that moves takes its bug along."""

from pathlib import Path

from tests.acceptance.planted_bugs import ROOT, planted_bugs


def test_each_bug_has_its_place_and_tests_beside_it() -> None:
    bugs = planted_bugs()
    assert len(bugs) >= 70
    for bug in bugs:
        code = (ROOT / bug.file).read_text(encoding="utf-8")
        assert bug.in_code(code) != code
        assert all(Path(ROOT / tests).exists() for tests in bug.tests), bug.name
