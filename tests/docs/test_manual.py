"""Commands of the manual print what the manual shows."""

import os
import re
import sys
import tomllib
from pathlib import Path

import pytest

from tests.docs.console import commands, run_commands

DOCS = Path(__file__).parents[2] / "docs"


def terminal_environment() -> dict[str, str]:
    """Return the environment of a terminal 80 columns wide, with labrig on the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "COLUMNS": "80", "PYTHONUTF8": "1"}


@pytest.mark.campaign
@pytest.mark.timeout(900)
def test_the_tutorial_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # for its cells of Python
    assert len(list(commands(DOCS / "tutorial.md"))) > 10
    run_commands(DOCS / "tutorial.md", tmp_path, terminal_environment())


@pytest.mark.drawn
def test_the_cells_of_a_notebook_run(examples: Path) -> None:
    cells = [cell for cell in commands(DOCS / "how-to/notebook.md") if cell.kind == "python"]
    assert len(cells) > 8
    namespace: dict[str, object] = {}
    for cell in cells:
        exec(compile(cell.text, "notebook.md", "exec"), namespace)


def test_the_worked_example_is_the_package_that_ci_runs() -> None:
    package = DOCS.parent / "tests/third_party"
    files = [*package.glob("lamp_drift/*.py"), package / "pyproject.toml"]
    texts = [path.read_text(encoding="utf-8") for path in files]
    page = (DOCS.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(?:python|toml)\n(.*?)^```$", page, re.M | re.S)
    assert len(blocks) > 8
    for block in blocks:
        assert any(block in text for text in texts), block


def test_extras_that_the_manual_names_are_declared() -> None:
    root = DOCS.parent
    pages = [*DOCS.rglob("*.md"), root / "README.md", root / "CONTRIBUTING.md"]
    named = {
        extra for page in pages for extra in re.findall(r"labrig\[(\w+)\]", page.read_text("utf-8"))
    }
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    assert named == set(project["optional-dependencies"])


def test_files_that_the_manual_names_are_there() -> None:
    root = DOCS.parent
    pages = [*DOCS.rglob("*.md"), root / "README.md", root / "CONTRIBUTING.md"]
    named = {
        path
        for page in pages
        for path in re.findall(
            r"`((?:labrig|drivers|protocols|sim|config|tests)/[\w./-]+)`", page.read_text("utf-8")
        )
    }
    assert len(named) > 40
    missing = [path for path in named if not (root / path).exists()]
    assert not missing
