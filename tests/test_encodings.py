"""Texts are read and written in an encoding that the code names, not in that of the locale.

Ruff holds that for `open`, `read_text` and the like; here are the functions that it does not hold.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import labrig

ROOT = Path(labrig.__file__).parent
TABLES = {"loadtxt", "savetxt", "genfromtxt", "fromregex"}
PROCESSES = {"run", "Popen", "check_output"}
#: Texts of which one is in every file with such a call: all others need not be parsed.
SIGNS = *TABLES, "text=", "universal_newlines="


def without_encoding(source: str) -> Iterator[int]:
    """Return the lines of calls that read or write text in the encoding of the locale."""
    if not any(sign in source for sign in SIGNS):
        return
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        keys = {keyword.arg for keyword in node.keywords}
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        is_text = name in TABLES or (name in PROCESSES and keys & {"text", "universal_newlines"})
        if is_text and "encoding" not in keys:
            yield node.lineno


@pytest.mark.parametrize(
    ("source", "lines"),
    [
        ("np.loadtxt(path)", [1]),
        ("subprocess.run(command, text=True)", [1]),
        ("subprocess.run(command, text=True, encoding='utf-8')", []),
        ("subprocess.run(command)", []),
    ],
)
def test_a_call_without_an_encoding_is_found(source: str, lines: list[int]) -> None:
    assert list(without_encoding(source)) == lines


def test_every_text_has_an_encoding() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for folder in ("", "drivers", "protocols", "sim")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line in without_encoding(path.read_text(encoding="utf-8"))
    ]
    assert not found
