"""Rendering of a result by the renderer that its protocol registers."""

from dataclasses import replace

from labrig.foundation.plugins import measurement
from labrig.report import any_result
from labrig.report.budgets import budget_lines, budget_sections
from labrig.report.sections import Rendered, Renderer, Source
from labrig.results import RunResult


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
    >>> from labrig.analyse import read_run_protocol
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
    show: Renderer = registered.load("report") or any_result.render
    rendered = show(result, source)
    return replace(
        rendered,
        sections=(*rendered.sections, *budget_sections(result)),
        lines=(*rendered.lines, *budget_lines(result)),
    )
