"""Keys of the files that users write, as people read them: value, default and meaning of each.

They come from the JSON Schema that editors use, so that manual, editor, `labrig explain` and the
check of a file say the same.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from labrig.schema import schema

_KINDS = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true, false"}


@dataclass(frozen=True)
class Key:
    """A key of a block.

    Attributes
    ----------
    name
        The key.
    value
        Values that it takes, in words; a block of keys by its name.
    default
        Value that it has if it is not given; empty for none.
    is_required
        Whether it has to be given.
    meaning
        Description.
    """

    name: str
    value: str
    default: str
    is_required: bool
    meaning: str


@dataclass(frozen=True)
class KeyBlock:
    """A block of keys of a file.

    Attributes
    ----------
    name
        Name of the block in the schema.
    title
        Key and value that choose it, such as `protocol: decay`, or its name.
    description
        Its description.
    keys
        Its keys.
    """

    name: str
    title: str
    description: str
    keys: tuple[Key, ...]


def key_blocks(kind: str) -> Iterator[KeyBlock]:
    """Yield the blocks of keys of a kind of file, protocols and drivers before what they share.

    Parameters
    ----------
    kind
        Kind of file, one of `labrig.schema.KINDS`.

    Raises
    ------
    UsageError
        There is no such kind of file.
    """
    whole = schema(kind)
    blocks = dict(whole.get("$defs", {}))
    if "properties" in whole:
        yield _block("The file", whole, blocks)
    for name, block in sorted(blocks.items(), key=lambda item: _chosen_by(item[1]) is None):
        branches = [block, *block.get("anyOf", [])]
        table = next((branch for branch in branches if branch.get("properties")), None)
        if table is not None:
            yield _block(name, {**table, "description": _summary(block, table)}, blocks)


def _block(name: str, block: dict[str, Any], blocks: dict[str, Any]) -> KeyBlock:
    required = block.get("required", ())
    return KeyBlock(
        name,
        _chosen_by(block) or name,
        block.get("description", ""),
        tuple(
            Key(
                key,
                _value(value, blocks),
                _default(value),
                key in required,
                " ".join(value.get("description", "").split()),
            )
            for key, value in block["properties"].items()
        ),
    )


def _chosen_by(block: dict[str, Any]) -> str | None:
    """Return the key that chooses a block with its value, such as `protocol: decay`."""
    for key in ("protocol", "driver"):
        if "const" in (value := block.get("properties", {}).get(key, {})):
            device = block.get("title", "").removeprefix(value["const"])
            return f"{key}: {value['const']}{device if device.startswith(' as ') else ''}"
    return None


def _summary(block: dict[str, Any], table: dict[str, Any]) -> str:
    text: str = block.get("description") or table.get("description") or ""
    return text.partition("\n\n")[0]


def _default(value: dict[str, Any]) -> str:
    default = value.get("default")
    is_block = isinstance(default, dict) or (isinstance(default, list) and len(default) > 6)
    if default is None or is_block:
        return ""
    return json.dumps(default, ensure_ascii=False).strip('"')


def _value(value: dict[str, Any], blocks: dict[str, Any]) -> str:
    """Return a short description of the values that a key takes."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        has_keys = any("properties" in x for x in (blocks[name], *blocks[name].get("anyOf", [])))
        return name if has_keys else _value(blocks[name], blocks)
    if "const" in value:
        return str(value["const"])
    if "enum" in value:
        return ", ".join(json.dumps(one).strip('"') for one in value["enum"])
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
