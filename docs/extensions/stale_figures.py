"""Marks on the pages of validation: figures whose code has changed since they were measured."""

import sys
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]


def _mark(app: Sphinx, docname: str, source: list[str]) -> None:
    folder, _, name = docname.partition("/")
    if folder == "validation":
        from tests.acceptance.validation_page import page

        source[0] = page(name, marked=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Have the pages read with marks; the campaigns are modules of the repository."""
    sys.path.insert(0, str(ROOT))
    app.connect("source-read", _mark)
    return {"parallel_read_safe": True}
