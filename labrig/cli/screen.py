"""Lines for people on a terminal: no longer than it is wide, and no number broken.

What goes into a file or a pipe stays as it is.
"""

import os
import re
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from textwrap import wrap
from typing import Any, TextIO

import typer

from labrig.cli.detachable_stream import DetachableStream
from labrig.foundation.number_format import aligned

#: Least width for which lines are laid out: a narrower terminal breaks them itself.
MIN_WIDTH = 30
#: Width that the last column of a table gets at least, before its rows are stacked.
MIN_SENTENCE = 24
#: Spaces within a quantity: between a number and its unit or power, about `±` and `×`.
_WITHIN_QUANTITY = re.compile(
    r"(?<=[\d)⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=[^\d\s]\S{0,5}(?:[\s,;:.)]|$))"
    r"|(?<=[±×≤≥<>=]) (?=\S)|(?<=\S) (?=[±×])"
)
#: Cells of a line, each with the spaces before it; cells are two spaces or more apart.
_CELL = re.compile(r"(\s*)(\S+(?:\s\S+)*)")


def echo(text: object = "", *, err: bool = False, **style: Any) -> None:
    """Print a text for people, its lines laid out for the terminal if there is one.

    Parameters
    ----------
    style
        Colour and weight, as `typer.style` takes them; a file or a pipe gets none.
    """
    width = terminal_width(sys.stderr if err else sys.stdout)
    if width is not None:
        lines = (part for line in str(text).split("\n") for part in laid_out(line, width))
        text = "\n".join(lines)
    typer.secho(text, err=err, **style)


def note(line: str) -> None:
    """Print a line on standard error; if nobody is there to read it, the run goes on."""
    width = terminal_width(sys.stderr)
    laid = [line] if width is None else laid_out(line, width)
    print("\n".join(laid), file=DetachableStream(sys.stderr), flush=True)


def echo_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; where it is wider than the terminal, its rows stand below each other.

    The last column may be of sentences, which go on below their beginning.
    """
    lines = aligned([head, *rows])
    width = terminal_width(sys.stdout)
    if width is not None:
        *columns, last = zip(head, *rows, strict=True)
        begins = sum(max(map(cells, column)) + 2 for column in columns)
        needed = begins + min(max(map(cells, last)), MIN_SENTENCE)
        lines = _stacked(head, rows) if needed > width else _continued(lines, begins, width)
    echo("\n".join(lines))


def _continued(lines: Sequence[str], begins: int, width: int) -> list[str]:
    """Return lines of a table whose last column, which begins at a column, is folded below it."""
    margin = " " * begins
    fold = partial(wrap, width=width, break_long_words=False, break_on_hyphens=False)
    return [part for line in lines for part in fold(line, subsequent_indent=margin)]


def _stacked(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the rows of a table, each as its first cell and a line for every other one."""
    lines = []
    for first, *others in rows:
        lines.append(f"{head[0]} {first}".strip())
        named = [(name, cell) for name, cell in zip(head[1:], others, strict=True) if cell]
        lines += [f"  {line}" for line in aligned(named)] if named else []
    return lines


def laid_out(line: str, width: int, hanging: int | None = None) -> Iterator[str]:
    """Yield a line of a text in lines that are not longer than a terminal is wide.

    Cells of a table, which are two spaces or more apart, go to the next line whole where they can,
    under the second one. Quantities are not broken; a single word may be longer than the terminal.

    Parameters
    ----------
    hanging
        Column at which further lines begin; without it, that of the second cell.
    """
    if cells(line) <= width or width < MIN_WIDTH:
        yield line
        return
    first = _CELL.match(line)
    second = first and _CELL.match(line, first.end())
    indent = cells(first[1]) + 2 if first else 0
    under_second = cells(line[: second.start(2)]) if second else indent
    if hanging is None:
        hanging = under_second if under_second <= width // 2 else indent
    margin = " " * hanging
    fold = partial(wrap, width=width, break_long_words=False, break_on_hyphens=False)
    laid = ""
    for gap, cell in _CELL.findall(line):
        if cells(laid + gap + cell) <= width:
            laid += gap + cell
            continue
        whole = _WITHIN_QUANTITY.sub("\N{NO-BREAK SPACE}", cell)
        begins = laid + gap + whole.split(" ", 1)[0]
        is_for_next_line = cells(margin + cell) <= width or cells(begins) > width
        if laid.strip() and is_for_next_line:
            yield laid.rstrip()
            start, gap = margin, ""
        else:
            start = laid
        *before, laid = fold(whole, initial_indent=start + gap, subsequent_indent=margin)
        yield from (part.replace("\N{NO-BREAK SPACE}", " ") for part in before)
        laid = laid.replace("\N{NO-BREAK SPACE}", " ")
    yield laid.rstrip()


def terminal_width(stream: TextIO) -> int | None:
    """Return the width of the terminal behind a stream; None if it is no terminal."""
    try:
        if not stream.isatty():
            return None
    except ValueError:  # it is closed
        return None
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns):
        return int(columns)
    try:
        return os.get_terminal_size(stream.fileno()).columns or None
    except (OSError, ValueError):
        return None


def cells(text: str) -> int:
    """Return how many cells of a terminal a text takes."""
    from rich.cells import cell_len  # slow to load

    return cell_len(text)
