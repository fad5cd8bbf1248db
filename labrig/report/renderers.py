"""Rendering of a result: by its protocol's renderer, as plain tables, or part by part."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from labrig.foundation.number_format import typeset
from labrig.foundation.plugins import measurement
from labrig.report.run_sections import budget_lines, budget_sections
from labrig.report.sections import Rendered, Renderer, Section, Source, Table
from labrig.results import RunResult, iter_values

#: Largest number of values that are shown; of longer arrays only the shape is shown.
MAX_SHOWN = 12


def plain_tables(result: RunResult, source: Source) -> Rendered:
    """Return a table of all fields of the result; names of nested fields are joined by dots."""
    rows = tuple(
        (".".join(path).replace("_", " "), _value_text(value))
        for path, value in iter_values(result)
        if path != ("warnings",)
    )
    table = Table(("Quantity", "Value"), rows, "Value with its standard uncertainty (1 σ).")
    lines = tuple(f"{name}: {value}" for name, value in rows)
    return Rendered((Section("Results", tables=(table,)),), lines)


def _value_text(value: Any) -> str:
    """Return a value of a result as text."""
    if isinstance(value, np.ndarray):
        if value.size > MAX_SHOWN:
            return f"{' × '.join(map(str, value.shape))} numbers"
        return ", ".join(f"{number:.6g}" for number in value.ravel())
    if isinstance(value, tuple | list):
        if len(value) > MAX_SHOWN:
            return f"{len(value)} values"
        return ", ".join(map(_value_text, value)) or "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    return "none" if value is None else str(value)


def render(result: RunResult, source: Source) -> Rendered:
    """Render a result by the registered renderer of its protocol, or as plain tables without one.

    The budgets of its headline values follow, a line each for the terminal.

    Parameters
    ----------
    result
        Result of the type that belongs to the run's protocol.
    source
        Run, protocol and rig of the result.

    Returns
    -------
    Rendered
        Sections of the report, and the most important numbers for the terminal.

    Raises
    ------
    UsageError
        If the registered renderer cannot be loaded.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.acquire import read_run_protocol
    >>> from labrig.record import RunDescription
    >>> from labrig.report import Source, render
    >>> run = labrig.read_run(Path("runs/decay"))
    >>> protocol = read_run_protocol(run.folder)
    >>> rig = labrig.read_rig_file(run.folder / "rig.yaml")
    >>> about = RunDescription(
    ...     title="sample", protocol="decay", run="decay", started="10:00", ended="10:30",
    ...     rig=rig.name, simulated=True, labrig_version="0.1.0"
    ... )
    >>> rendered = render(labrig.read_result(run.folder), Source(run, protocol, rig, about))
    >>> [section.title for section in rendered.sections]
    ['Results', 'Sample', 'Patch sample', 'Timing and stability', 'Not in σ',
     'How far each number may be trusted']
    """
    registered = measurement(result.kind, str(source.run.folder))
    show: Renderer = registered.load("report") or plain_tables
    rendered = show(result, source)
    return replace(
        rendered,
        sections=(*rendered.sections, *budget_sections(result)),
        lines=tuple(map(typeset, (*rendered.lines, *budget_lines(result)))),
    )


def render_chain(
    results: Mapping[str, RunResult],
    source: Source,
    first: Section,
    last: Sequence[Section] = (),
) -> Rendered:
    """Render every part of a chain that has a result, between sections about the whole."""
    rendered = {name: render(results[name], part) for name, part in _parts(results, source)}
    sections = [first]
    for name, rendered_part in rendered.items():
        sections += [replace(section, part=name) for section in rendered_part.sections]
    return Rendered(
        (*sections, *last),
        tuple(
            f"{name}: {line}"
            for name, rendered_part in rendered.items()
            for line in rendered_part.lines
        ),
        tuple(section for rendered_part in rendered.values() for section in rendered_part.methods),
    )


def _parts(results: Mapping[str, RunResult], source: Source) -> Iterator[tuple[str, Source]]:
    """Yield name and source of every part of the chain that has a result."""
    for link in source.protocol.chain():
        if link.name in results:
            run = source.run.part(link.name)
            yield (
                link.name,
                replace(source, run=run, protocol=link.protocol, anchor=f"{link.name}-"),
            )
