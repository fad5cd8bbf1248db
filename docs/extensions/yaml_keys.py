"""The directive `yaml-keys`: tables of the keys of a YAML file, from its JSON Schema.

    ```{yaml-keys} protocol
    ```

The schema is the one that editors use (`labrig schema protocol`), so that the manual, the editor's
hover text and the check of a file say the same.
"""

import json
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from labrig.schema import schema

_KINDS = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true, false"}


class YamlKeys(SphinxDirective):
    """Tables of all keys of one kind of file, a section for each of its blocks."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place of the directive."""
        kind = self.arguments[0]
        text = "\n".join(_document(schema(kind)))
        # Files of two kinds may have a block in common: a label stands once in the manual.
        text = text.replace("(keys-", f"(keys-{kind}-").replace("(#keys-", f"(#keys-{kind}-")
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _document(whole: dict[str, Any]) -> Iterator[str]:
    blocks = dict(whole.get("$defs", {}))
    if "properties" in whole:
        yield from _block("The file", whole, blocks)
    # Protocols and drivers first, then the blocks that they have in common.
    for name, block in sorted(blocks.items(), key=lambda item: _kind(item[1]) is None):
        branches = [block, *block.get("anyOf", [])]
        table = next((branch for branch in branches if branch.get("properties")), None)
        if table is not None:
            yield from _block(name, {**table, "description": _summary(block, table)}, blocks)


def _kind(block: dict[str, Any]) -> str | None:
    """Return the key that chooses a block with its value, such as `protocol: decay`."""
    for key in ("protocol", "driver"):
        if "const" in (value := block.get("properties", {}).get(key, {})):
            device = block.get("title", "").removeprefix(value["const"])
            return f"`{key}: {value['const']}`{device if device.startswith(' as ') else ''}"
    return None


def _summary(block: dict[str, Any], table: dict[str, Any]) -> str:
    text: str = block.get("description") or table.get("description") or ""
    return text.partition("\n\n")[0]


def _block(name: str, block: dict[str, Any], blocks: dict[str, Any]) -> Iterator[str]:
    yield f"({_anchor(name)})="
    yield f"## {_kind(block) or name}\n"
    yield f"{block.get('description', '')}\n"
    yield "{.keys}"
    yield "| key | value | default | meaning |"
    yield "|---|---|---|---|"
    required = block.get("required", ())
    for key, value in block["properties"].items():
        default = "*required*" if key in required else _default(value)
        meaning = " ".join(value.get("description", "").split()).replace("|", "\\|")
        yield f"| `{key}` | {_value(value, blocks)} | {default} | {meaning} |"
    yield ""


def _anchor(name: str) -> str:
    return "keys-" + "".join(letter if letter.isalnum() else "-" for letter in name.lower())


def _default(value: dict[str, Any]) -> str:
    default = value.get("default")
    is_block = isinstance(default, dict) or (isinstance(default, list) and len(default) > 6)
    if default is None or is_block:
        return ""
    return f"`{json.dumps(default, ensure_ascii=False).strip(chr(34))}`"


def _value(value: dict[str, Any], blocks: dict[str, Any]) -> str:
    """Return a short description of the values that a key takes."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        has_table = any("properties" in x for x in (blocks[name], *blocks[name].get("anyOf", [])))
        return f"[{name}](#{_anchor(name)})" if has_table else _value(blocks[name], blocks)
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return ", ".join(f"`{json.dumps(one).strip(chr(34))}`" for one in value["enum"])
    if choices := value.get("anyOf") or value.get("oneOf"):
        texts = [_value(one, blocks) for one in choices if one.get("type") != "null"]
        return " or ".join(dict.fromkeys(texts))
    if value.get("type") == "array":
        if items := value.get("prefixItems"):
            return f"{len(items)} numbers"
        return f"list of: {_value(value['items'], blocks)}"
    if value.get("type") == "object":
        inner = value.get("additionalProperties")
        return f"names, each with: {_value(inner, blocks)}" if isinstance(inner, dict) else "keys"
    return _scalar(value)


def _scalar(value: dict[str, Any]) -> str:
    pattern = value.get("pattern", "")
    if r"\d" in pattern:
        units = pattern.rstrip("$").rpartition("(")[2].partition(")")[0]
        return "duration with unit" if "min" in units else f"number with unit ({units})"
    kind = _KINDS.get(value.get("type", ""), "value")
    limits = [
        f"{sign} {value[key]:g}"
        for key, sign in (
            ("minimum", "≥"),
            ("exclusiveMinimum", ">"),
            ("maximum", "≤"),
            ("exclusiveMaximum", "<"),
        )
        if key in value
    ]
    return f"{kind} {', '.join(limits)}".strip()


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive to Sphinx."""
    app.add_directive("yaml-keys", YamlKeys)
    return {"parallel_read_safe": True}
