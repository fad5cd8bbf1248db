"""Mistakes in YAML in plain words, at the line where the mistake is.

A parser notices a mistake where it can go on no more, which is often a line later: a colon that is
missing in one line makes the next one impossible.
"""

import re
from dataclasses import dataclass
from typing import Protocol

#: Largest length of a line quoted in a message.
MAX_SHOWN = 60
_KEY_LINE = re.compile(r"\s*(?:- +)?(?:\"[^\"]*\"|'[^']*'|[^\s#:][^#:]*):(?:\s|$)")
_NO_BLANK = re.compile(r"\s*(?:- +)?[A-Za-z_][\w .-]*:\S")
_OPENED = {"{": "}", "[": "]"}


class Mark(Protocol):
    """Place in a text, counted from 0."""

    line: int
    column: int


class MarkedError(Protocol):
    """The part of PyYAML's and libyaml's errors that is used."""

    @property
    def context(self) -> str | None:
        """Structure that the parser was reading."""

    @property
    def context_mark(self) -> Mark | None:
        """Start of that structure."""

    @property
    def problem(self) -> str | None:
        """Problem at which it stopped."""

    @property
    def problem_mark(self) -> Mark | None:
        """Place of the problem."""


@dataclass(frozen=True)
class YamlMistake:
    """A mistake in YAML.

    Attributes
    ----------
    line
        Number of its line, from 1; None if it has none.
    text
        Cause and remedy.
    """

    line: int | None
    text: str


def explain(error: MarkedError, text: str) -> YamlMistake:
    r"""Return the mistake that a parser stumbled over.

    Parameters
    ----------
    error
        Error of PyYAML or libyaml.
    text
        Text that was parsed.

    Examples
    --------
    >>> import yaml
    >>> from labrig.foundation.yaml_mistake import explain
    >>> text = "lamp:\n  driver numato\n  relay: 0\n"
    >>> try:
    ...     yaml.safe_load(text)
    ... except yaml.MarkedYAMLError as error:
    ...     print(explain(error, text).line)
    2
    """
    lines = text.split("\n")
    problem = " ".join(str(error.problem or error.context).split())
    if error.problem_mark is None:
        return YamlMistake(None, problem)
    # libyaml counts the end of the text as a line of its own.
    last = len(lines) - 1
    at = min(error.problem_mark.line, last)
    begun = None if error.context_mark is None else min(error.context_mark.line, last)
    if _is_indented_by_tab(lines, error.problem_mark.line):
        return _at(at, "expected spaces before the first word, got a tab; YAML indents with spaces")
    if "nesting depth" in problem:
        return _at(at, problem)
    if "mapping values are not allowed" in problem:
        return _second_colon(lines, at)
    if "could not find expected ':'" in problem and begun is not None:
        return _missing_colon(lines, begun)
    if "scanning a quoted scalar" in str(error.context) and begun is not None:
        return _at(begun, "the quotation mark that is opened here is closed nowhere; close it")
    if "flow" in str(error.context) and begun is not None:
        return _unclosed(error, lines, at, begun)
    if begun is not None and re.search(r"expected (key|'-' indicator|<block end>)", problem):
        return _odd_in_block(
            lines,
            at,
            begun,
            is_list="sequence" in str(error.context) or "collection" in str(error.context),
        )
    if "cannot start any token" in problem:
        column = error.problem_mark.column
        sign = lines[at][column : column + 1]
        return _at(at, f"no value begins with '{sign}'; write it in quotation marks")
    if "another document" in problem:
        return _at(at, "expected one document, got a second one after '---'; delete one of them")
    if "undefined alias" in problem:
        return _at(
            at, f"{problem}: '*' refers to what is marked by '&'; write a text in quotation marks"
        )
    return _at(at, problem)


def _at(line: int, text: str) -> YamlMistake:
    return YamlMistake(line + 1, text)


def _shown(line: str) -> str:
    text = " ".join(line.split())
    return text if len(text) <= MAX_SHOWN else text[:MAX_SHOWN] + "…"


def _is_indented_by_tab(lines: list[str], line: int) -> bool:
    """Return whether a line has a tab before its first word."""
    begin = lines[line] if line < len(lines) else ""
    return "\t" in begin[: len(begin) - len(begin.lstrip())]


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _before(lines: list[str], at: int) -> int | None:
    """Return the last line before one that has more than blanks and comments."""
    return next((n for n in range(at - 1, -1, -1) if lines[n].split("#")[0].strip()), None)


def _second_colon(lines: list[str], at: int) -> YamlMistake:
    """Return why a key cannot stand in a line: a colon in a value, or the line before."""
    if len(re.findall(r":(?=\s)", lines[at])) > 1:
        return _at(
            at,
            f"two colons in '{_shown(lines[at])}'; write a value with a colon in it in quotation "
            "marks, one key a line",
        )
    before = _before(lines, at)
    if before is not None and not _KEY_LINE.match(lines[before]):
        return _missing_colon(lines, before)
    if before is not None and _indent(lines[before]) < _indent(lines[at]):
        return _at(
            at,
            f"'{_shown(lines[at])}' is indented more than '{_shown(lines[before])}' before it, "
            "which has a value; indent both alike",
        )
    return _at(at, f"no key can stand here: '{_shown(lines[at])}'")


def _missing_colon(lines: list[str], at: int) -> YamlMistake:
    what = "a blank after the colon" if _NO_BLANK.match(lines[at]) else "a colon and a blank"
    return _at(at, f"expected 'key: value', got '{_shown(lines[at])}'; it lacks {what}")


def _unclosed(error: MarkedError, lines: list[str], at: int, begun: int) -> YamlMistake:
    """Return that a bracket is not closed in its line, or that a comma is missing in it."""
    assert error.context_mark is not None
    opened = lines[begun][error.context_mark.column : error.context_mark.column + 1]
    closed = _OPENED.get(opened, "a bracket")
    if at != begun:
        return _at(begun, f"'{opened}' is opened here and not closed; it lacks '{closed}'")
    return _at(
        at,
        f"expected ',' between the values within '{opened}…{closed}', got none in "
        f"'{_shown(lines[at])}'",
    )


def _odd_in_block(lines: list[str], at: int, begun: int, *, is_list: bool) -> YamlMistake:
    """Return that a line does not go on with the keys, or the list, above it."""
    line = _shown(lines[at]) if at < len(lines) else ""
    first = _shown(lines[begun])
    if is_list and not lines[at].lstrip().startswith("-"):
        return _at(
            at,
            f"expected another entry '- …' of the list in line {begun + 1}, got "
            f"'{line}'; a list and keys cannot be mixed",
        )
    if _indent(lines[at]) != _indent(lines[begun]):
        return _at(
            at,
            f"'{line}' is indented otherwise than all keys above it; indent it like '{first}' "
            f"(line {begun + 1}), or like one of those within",
        )
    return _at(at, f"expected 'key: value' as in line {begun + 1}, got '{line}'")
