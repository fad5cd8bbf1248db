"""Tables with commas as labrig writes them, in which a spreadsheet runs nothing.

A spreadsheet takes a cell that begins with `=`, `+`, `-`, `@`, a tab or a carriage return for a
formula, which can start programs and open addresses. Names of samples, patches and cameras come
from other people's files. An apostrophe is therefore written before such a text, which spreadsheets
show, and `plain_text` takes away. Spreadsheets of some countries divide cells at semicolons, even
within quotation marks, so that the same is done after every separator.
"""

import csv
import io
import re
from collections.abc import Iterable, Sequence
from typing import Any

#: Start of a cell: that of the text, or after a separator, with blanks and quotation marks.
_BEGIN = r'(?P<begin>(?:^|[,;|\t\r\n])[ \u00a0"]*)'
#: Characters that make a formula of a cell, also in their wide forms.
_FORMULA = r"(?P<quotes>'*)(?=[=+\-@\t\r\uff1d\uff0b\uff0d\uff20])"
_UNQUOTED = re.compile(_BEGIN + _FORMULA)
_QUOTED = re.compile(_BEGIN + "'" + _FORMULA)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|nan)")


def cell_text(text: str) -> str:
    """Return a text as it is written into a cell of a table; a number stays as it is.

    Parameters
    ----------
    text
        Text of a cell or of a comment, such as a name that a user gave.

    Returns
    -------
    str
        The text with an apostrophe wherever a formula would begin.

    Examples
    --------
    >>> from labrig.text_table import cell_text
    >>> cell_text("blue paint"), cell_text("=1+1"), cell_text("-0.5"), cell_text("a;@b")
    ('blue paint', "'=1+1", '-0.5', "a;'@b")
    """
    return text if _NUMBER.fullmatch(text) else _UNQUOTED.sub(r"\g<begin>'\g<quotes>", text)


def plain_text(cell: str) -> str:
    """Return the text that `cell_text` has written into a cell.

    Parameters
    ----------
    cell
        Text in a cell or a comment of a table.

    Returns
    -------
    str
        The text without the apostrophes before formulas.

    Examples
    --------
    >>> from labrig.text_table import plain_text
    >>> plain_text("'=1+1"), plain_text("l'eau")
    ('=1+1', "l'eau")
    """
    return _QUOTED.sub(r"\g<begin>\g<quotes>", cell)


def table_text(
    head: Sequence[str], rows: Iterable[Sequence[Any]], comments: Iterable[str] = ()
) -> str:
    r"""Return a table with commas, whose first line after the comments names the columns.

    Parameters
    ----------
    head
        Names of the columns.
    rows
        Cells of each row, texts or numbers.
    comments
        Lines above the table, each of which begins with `#`.

    Returns
    -------
    str
        Text of the file, each line with its end.

    Examples
    --------
    >>> from labrig.text_table import table_text
    >>> table_text(["patch", "value"], [["=left", -0.5]])
    "patch,value\n'=left,-0.5\n"
    """
    text = io.StringIO()
    for comment in comments:
        text.write(f"{cell_text(comment)}\n")
    table = csv.writer(text, lineterminator="\n")
    for row in (head, *rows):
        table.writerow([cell_text(cell) if isinstance(cell, str) else cell for cell in row])
    return text.getvalue()
