"""Fill the generated parts of the reference pages: `python docs/reference_pages.py`.

A part stands between `<!-- generated: PART -->` and `<!-- end -->`, so that the pages are readable
in the repository as in the manual; `tests/docs` checks that they are current.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from typer.cli import get_docs_for_click

from labrig.cli.app import command
from labrig.explain import WarningText, warning_texts
from labrig.foundation import resources, result_warning
from labrig.schema_keys import Key, KeyBlock, key_blocks

PAGES = Path(__file__).parent / "reference"
_PART = re.compile(r"(<!-- generated: ([\w ]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def current(page: str) -> str:
    """Return the text of a page with its generated parts made anew."""
    return _PART.sub(lambda part: f"{part[1]}\n{_generated(part[2])}\n{part[3]}", page)


def _generated(part: str) -> str:
    name, _, kind = part.partition(" ")
    lines = {"keys": lambda: _keys(kind), "commands": _commands, "warnings": _warnings}[name]()
    return "\n".join(lines)


def _keys(kind: str) -> Iterator[str]:
    blocks = list(key_blocks(kind))
    names = {block.name for block in blocks}
    for block in blocks:
        yield f"({_anchor(kind, block.name)})="
        yield f"## {block.title if block.title == block.name else f'`{block.title}`'}\n"
        yield f"{block.description}\n"
        yield from _table(kind, block, names)


def _table(kind: str, block: KeyBlock, names: set[str]) -> Iterator[str]:
    yield "{.keys}"
    yield "| key | value | default | meaning |"
    yield "|---|---|---|---|"
    for key in block.keys:
        default = "*required*" if key.is_required else f"`{key.default}`" if key.default else ""
        meaning = key.meaning.replace("|", "\\|")
        yield f"| `{key.name}` | {_value(kind, key, names)} | {default} | {meaning} |"
    yield ""


def _value(kind: str, key: Key, names: set[str]) -> str:
    """Return the values of a key with links to the blocks that they name."""
    return re.sub(
        r"\w+",
        lambda word: f"[{word[0]}](#{_anchor(kind, word[0])})" if word[0] in names else word[0],
        key.value,
    )


def _anchor(kind: str, name: str) -> str:
    letters = "".join(letter if letter.isalnum() else "-" for letter in name.lower())
    return f"keys-{kind}-{letters}"


def _commands() -> Iterator[str]:
    whole = command()
    with whole.make_context("labrig", [], resilient_parsing=True) as context:
        # Typer declares a subclass of this context, and uses nothing that only that has.
        text = get_docs_for_click(obj=whole, ctx=cast(Any, context), name="labrig")
    yield text.partition("\n")[2].strip() + "\n"


def _warnings() -> Iterator[str]:
    texts = warning_texts([resources.folder("."), resources.folder("protocols")])
    for kind in dict.fromkeys(text.kind for text in texts):
        yield f"## {kind.title()}\n"
        yield f"{_meaning(kind)}\n"
        yield "| code | sentence |"
        yield "|---|---|"
        yield from (_row(text) for text in texts if text.kind == kind)
        yield ""


def _row(text: WarningText) -> str:
    sentences = "<br>".join(sentence.replace("|", "\\|") for sentence in text.sentences)
    return f"| `{text.code}` | {sentences} |"


def _meaning(kind: str) -> str:
    of_kind = next(
        each for each in result_warning.ResultWarning.__subclasses__() if each.kind == kind
    )
    return str(of_kind.__doc__)


def main() -> int:
    """Write every page whose generated parts are stale."""
    for path in sorted(PAGES.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if (new := current(text)) != text:
            path.write_text(new, encoding="utf-8")
            print(f"{path.name}: written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
