"""The directive `typer-commands`: what `labrig --help` says of every command.

Typer brings its own copy of click, which sphinx-click does not know; Typer's own Markdown serves.
"""

from typing import Any, cast

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.cli import get_docs_for_click

from labrig.cli.app import command


class TyperCommands(SphinxDirective):
    """All commands of labrig, a section for each."""

    def run(self) -> list[nodes.Node]:
        """Parse Typer's Markdown in place of the directive."""
        whole = command()
        with whole.make_context("labrig", [], resilient_parsing=True) as context:
            # Typer declares a subclass of this context, and uses nothing that only that has.
            text = get_docs_for_click(obj=whole, ctx=cast(Any, context), name="labrig")
        _, _, sections = text.partition("\n")
        return self.parse_text_to_nodes(sections, allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive to Sphinx."""
    app.add_directive("typer-commands", TyperCommands)
    return {"parallel_read_safe": True}
