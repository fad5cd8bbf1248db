"""The table of samples with their runs, for terminals of any width and for pipes, and its CSV."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import shorten
from typing import TYPE_CHECKING, Self

import typer

from labrig.cli.inline_picture import (
    COLUMNS as PICTURE_COLUMNS,
    ROWS as PICTURE_ROWS,
    InlinePictures,
)
from labrig.cli.screen import cells, laid_out

if TYPE_CHECKING:
    from labrig.catalogue import RunSummary
    from labrig.results import Measured

#: Longest result that is listed in one line where no terminal folds it.
HEADLINE_LENGTH = 100
#: Width from which a result stands beside its run, instead of below it.
MIN_RESULT_COLUMNS = 30
#: Width of a terminal from which pictures stand beside the samples.
MIN_PICTURE_COLUMNS = 70
#: Samples that have a picture, the last ones: no screen shows more.
MAX_PICTURES = 50

_INDENT = "  "
_PICTURE_COLUMNS = PICTURE_COLUMNS + len(_INDENT)
_COLOURS = {
    "running": "blue",
    "interrupted": "yellow",
    "failed": "red",
    "damaged": "red",
    "processed": "green",
}


def samples_table(
    runs: Sequence["RunSummary"], columns: int | None, pictures: InlinePictures | None
) -> str:
    """Return the table of samples, each with its runs, the sample measured last at the end.

    Parameters
    ----------
    runs
        Summaries in the order in which the runs were made.
    columns
        Width of the terminal; None where nothing is folded.
    pictures
        Pictures of the terminal; None for none.
    """
    if columns is not None and columns < MIN_PICTURE_COLUMNS:
        pictures = None
    by_sample: dict[str, list[RunSummary]] = {}
    for run in runs:
        by_sample.setdefault(run.sample, []).append(run)
    # The run that was made last is the last one of the table.
    samples = list(dict.fromkeys(run.sample for run in reversed(runs)))[::-1]
    layout = _Layout.of(runs, columns)
    lines = []
    for number, sample in enumerate(samples, start=MAX_PICTURES - len(samples)):
        picture = "" if pictures is None or number < 0 else pictures.of(by_sample[sample])
        block = [typer.style(printable(sample), bold=True)]
        if picture:
            block += layout.narrower(_PICTURE_COLUMNS).lines(by_sample[sample])
            block += [""] * (PICTURE_ROWS - len(block))
            # The cursor goes over the picture: blanks would erase it.
            block = [f"\x1b[{_PICTURE_COLUMNS}C{line}" for line in block]
        else:
            block += layout.lines(by_sample[sample])
        lines.append(picture + "\n".join(block))
    return "\n".join(lines)


@dataclass(frozen=True)
class _Layout:
    """Widths of the columns, which all samples share.

    Attributes
    ----------
    name, status
        Widths of these columns.
    all
        Width of the whole; None where nothing is folded.
    """

    name: int
    status: int
    all: int | None

    @classmethod
    def of(cls, runs: Sequence["RunSummary"], columns: int | None) -> Self:
        name, status = (max(cells(text(run)) for run in runs) for text in (_name, _status))
        return cls(name, status, columns)

    def narrower(self, columns: int) -> Self:
        return self if self.all is None else replace(self, all=self.all - columns)

    def lines(self, runs: Sequence["RunSummary"]) -> Iterator[str]:
        """Yield the lines of a sample's runs, results beside the names or, if narrow, below."""
        before = self.name + self.status + 3 * len(_INDENT)
        if self.all is not None and self.all - before < MIN_RESULT_COLUMNS:
            yield from self._lines_below(runs, self.all)
            return
        result_columns = None if self.all is None else self.all - before
        for run in runs:
            name, status = _name(run), _status(run)
            head = (
                f"{_INDENT}{name}{' ' * (self.name - cells(name))}{_INDENT}{_coloured(run)}"
                f"{' ' * (self.status - cells(status))}{_INDENT}"
            )
            first, *others = list(_results(run, result_columns)) or [""]
            yield f"{head}{first}".rstrip()
            yield from (" " * before + line for line in others)

    def _lines_below(self, runs: Sequence["RunSummary"], columns: int) -> Iterator[str]:
        for run in runs:
            yield _INDENT + _name(run)
            for line in (_coloured(run), *_results(run, columns - 2 * len(_INDENT))):
                yield 2 * _INDENT + line


def _coloured(run: "RunSummary") -> str:
    return typer.style(_status(run), fg=_COLOURS.get(run.status))


def _name(run: "RunSummary") -> str:
    return printable(run.folder.name)


def _status(run: "RunSummary") -> str:
    return run.status if run.done == run.units else f"{run.status}, {progress_text(run)}"


def progress_text(run: "RunSummary") -> str:
    """Return how many units of a run are complete, of how many."""
    return f"{run.done} of {'?' if run.units is None else run.units}"


def printable(text: str) -> str:
    """Return text without what a terminal would take for a command."""
    return "".join(character if character.isprintable() else "\ufffd" for character in text)


def _results(run: "RunSummary", columns: int | None) -> Iterator[str]:
    """Yield the lines of a run's result, no number of which is broken."""
    decays = [_decay_text(*decay) for decay in run.parameters.items()]
    for text in decays or [run.headline]:
        line = " ".join(printable(text).split())
        if not decays:
            line = shorten(line, HEADLINE_LENGTH, placeholder=" …")
        yield from [line] if columns is None else laid_out(line, columns, hanging=0)


def _decay_text(patch: str, parameters: Mapping[str, "Measured"]) -> str:
    """Return the rates of a decay ± σ, or the parameters of its law with their symbols."""
    from labrig.results import LAW_SYMBOLS, parameter_text

    texts = [parameter_text(name, each.plus_minus) for name, each in parameters.items()]
    text = ", ".join(texts)
    if parameters and not parameters.keys() & LAW_SYMBOLS.keys():
        text = f"k_r {text} 1/s"
    return f"{patch}: {text}" if patch else text


def runs_csv(runs: Sequence["RunSummary"]) -> str:
    """Return the table of runs with commas: a row a run, a column each for a value and its σ.

    Columns are named as in the files of a result: `k_r of state 1 (1/s)`, then
    `k_r of state 1_sigma (1/s)`.
    """
    from labrig.text_table import table_text

    about = ("run", "sample", "protocol", "status", "began_utc", "units_done", "units", "frames")
    columns = dict.fromkeys(
        (name, value.unit) for run in runs for name, value in run.values.items()
    )
    head = [*about, *(each for column in columns for each in _value_head(*column)), "result"]
    rows = []
    for run in runs:
        row: list[str | float] = [
            *(run.folder.name, run.sample, run.protocol, run.status),
            "" if run.began is None else f"{run.began:%Y-%m-%dT%H:%M:%SZ}",
            *(run.done, "" if run.units is None else run.units, run.frames),
        ]
        for name, unit in columns:
            value = run.values.get(name)
            if value is None or value.unit != unit:
                row += ["", ""]
            else:
                row += [value.value, value.sigma if math.isfinite(value.sigma) else ""]
        rows.append([*row, "" if run.parameters else run.headline])
    return table_text(head, rows)


def _value_head(name: str, unit: str) -> tuple[str, str]:
    in_unit = f" ({unit})" if unit else ""
    return f"{name}{in_unit}", f"{name}_sigma{in_unit}"
