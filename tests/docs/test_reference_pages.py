"""Reference pages: their generated parts are current, and warnings are named soundly."""

import importlib.util
import re
from collections import Counter
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def _module() -> object:
    spec = importlib.util.spec_from_file_location("reference_pages", DOCS / "reference_pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", sorted(path.stem for path in (DOCS / "reference").glob("*.md")))
def test_generated_parts_are_current(name: str) -> None:
    page = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")
    current = _module().current(page)  # type: ignore[attr-defined]
    assert current == page, "run: python docs/reference_pages.py"


def test_a_code_stands_for_one_kind_of_limit_in_lower_case_words() -> None:
    page = (DOCS / "reference" / "warnings.md").read_text(encoding="utf-8")
    codes = re.findall(r"^\| `([^`]+)` \|", page, re.MULTILINE)
    assert len(codes) > 100
    assert not [code for code, n in Counter(codes).items() if n > 1]
    assert not [each for each in codes if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", each)]
