"""What the README shows of a notebook works as it stands there."""

import re
import textwrap
from pathlib import Path

import pytest

from tests.export.conftest import Finished

README = Path(__file__).parents[2] / "README.md"


def test_the_notebook_of_the_readme_runs(
    finished: Finished, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    section = README.read_text(encoding="utf-8").partition("In a notebook:\n")[2]
    shown = re.search(r"    import labrig\n(?:(?:    .*)?\n)+", section)
    assert shown is not None
    code = textwrap.dedent(shown[0])
    monkeypatch.setenv("MPLBACKEND", "agg")
    run = re.search(r"runs/[^/\"]+", code)
    assert run is not None
    exec(code.replace(run[0], str(finished.folder)), {})
    assert "reduced χ²" in capsys.readouterr().out
