"""From a result of any protocol to its part of a report."""

from labrig.plugins import REPORTS, load, names
from labrig.report import any_result
from labrig.report.sections import Rendered, Renderer, Source
from labrig.results import RunResult


def render(result: RunResult, source: Source) -> Rendered:
    """As the protocol's registered renderer shows it; plain tables without one."""
    show: Renderer = any_result.render
    if result.kind in names(REPORTS):
        show = load(REPORTS, result.kind, str(source.run.folder))
    return show(result, source)
