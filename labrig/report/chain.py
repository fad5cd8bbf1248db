"""Report of a chain: a section about the whole, then those of every part."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from labrig.report.renderers import render
from labrig.report.sections import Rendered, Section, Source
from labrig.results import RunResult


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
