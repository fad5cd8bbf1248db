"""Editing of `patches:` in a user's protocol file, without any other change.

Only the characters of that value are replaced, so that comments, order and spelling of the rest
are preserved. The new text is parsed and checked before it is returned.
"""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from labrig.acquire import read_protocol
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.output_file import write_durably
from labrig.foundation.region import Region
from labrig.foundation.yaml_file import parse_yaml

KEY = "patches"
#: Decimals of written fractions: finer than a pixel of a live picture, still readable.
DECIMALS = 4
INDENT = "  "

_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
#: Words that some YAML parser reads as a boolean or as null.
_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n"})
_REST_OF_LINE = re.compile(r"[ \t]*(?:#[^\r\n]*)?(?=\r?\n|\Z)")
_COLON = re.compile(r"[ \t]*:[ \t]*")


def write_patches(path: Path, patches: Mapping[str, Region]) -> None:
    """Replace the patches in the protocol at `path`, atomically.

    Raises
    ------
    UsageError
        If the file cannot be changed without other changes, or would not be a valid protocol.
    DiskError
        If the file cannot be written.
    """
    text = read_text(path)
    parse_yaml(text, str(path))  # held to the limits of such a file
    changed = with_patches(text, patches, str(path))
    # Beside it, because a protocol may name files relative to its own folder.
    trial_file = path.with_name(f".{path.name}.trial.yaml")
    try:
        write_durably(trial_file, changed.encode("utf-8"))
        read_protocol(trial_file)
    except UsageError as error:
        raise UsageError(str(error).replace(str(trial_file), str(path))) from None
    finally:
        trial_file.unlink(missing_ok=True)
    write_durably(path.resolve(), changed.encode("utf-8"))  # a link stays one


def with_patches(text: str, patches: Mapping[str, Region], source: str) -> str:
    """Return the YAML `text` with `patches` as its patches.

    Parameters
    ----------
    text
        Content of a protocol file.
    patches
        Regions by name, in fractions of the frame.
    source
        Name or path of the file, for messages.

    Raises
    ------
    UsageError
        If the text is not YAML, or the patches cannot be replaced without other changes.
    """
    before = parse_yaml(text, source)
    new_patches = {name: rounded(region) for name, region in patches.items()}
    for candidate in _candidates(text, new_patches):
        try:
            after = parse_yaml(candidate, source)
        except UsageError:
            continue
        written = after.pop(KEY, None)
        others = {key: value for key, value in before.items() if key != KEY}
        # Compared as text, because not-a-number is never equal to itself.
        same = repr(after) == repr(others) and list(written or ()) == list(new_patches)
        if same and all(tuple(written[name]) == region for name, region in new_patches.items()):
            return candidate
    raise UsageError(
        f"{source}: '{KEY}' is written so that it cannot be changed without touching the rest; "
        f"write it by hand: {' '.join(_entries(new_patches, '', ' '))}"
    )


def rounded(region: Region) -> Region:
    """Return the region with rounded edges, which still ends inside the frame."""
    x, y, width, height = region
    left, top = round(x, DECIMALS), round(y, DECIMALS)
    right, low = round(x + width, DECIMALS), round(y + height, DECIMALS)
    return left, top, round(right - left, DECIMALS), round(low - top, DECIMALS)


def _candidates(text: str, patches: Mapping[str, Region]) -> Iterator[str]:
    """Yield candidates of the new text, the best first; the caller parses and checks them."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if not isinstance(root, yaml.MappingNode) or root.flow_style:
        return
    newline = "\r\n" if "\r\n" in text else "\n"
    indent = " " * root.start_mark.column
    lines = [indent + line for line in _entries(patches, INDENT, newline)]
    for key, value in root.value:
        if key.value == KEY:
            yield _replaced(text, key, value, "".join(lines))
            return
    block = f"{indent}{KEY}:{newline}" + "".join(lines)
    end = _document_end(text)
    ended = text[:end] + ("" if text[:end].endswith("\n") else newline)
    yield ended + block + text[end:]
    # A block of text at the end would swallow the line break that was added to it.
    start = root.start_mark.index - root.start_mark.column
    yield text[:start] + block + text[start:]


def _entries(patches: Mapping[str, Region], indent: str, newline: str) -> list[str]:
    return [
        f"{indent}{_scalar(name)}: [{', '.join(f'{v:g}' for v in region)}]{newline}"
        for name, region in patches.items()
    ]


def _scalar(name: str) -> str:
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS:
        return name
    return json.dumps(name, ensure_ascii=False)  # double-quoted YAML reads the same escapes


def _replaced(text: str, key: yaml.Node, value: yaml.Node, lines: str) -> str:
    end = _end_of(value)
    rest_of_line = _REST_OF_LINE.match(text, end)
    if rest_of_line is None:
        return ""  # something else follows on the line: not a value that can be taken out
    newline = "\r\n" if "\r\n" in text else "\n"
    after = text[rest_of_line.end() :].removeprefix(newline)
    if value.start_mark.line > key.start_mark.line:
        start = value.start_mark.index - value.start_mark.column
        return text[:start] + lines + after
    colon = _COLON.match(text, key.end_mark.index)
    if colon is None:
        return ""
    # A comment after the value is kept after the key.
    return text[: key.end_mark.index] + ":" + rest_of_line[0].rstrip() + newline + lines + after


def _end_of(node: yaml.Node) -> int:
    """Return the index after the last character of a node.

    A block's own end mark is where the next node begins.
    """
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        parts = last if isinstance(last, tuple) else (last,)
        return max(_end_of(part) for part in parts)
    return int(node.end_mark.index)


def _document_end(text: str) -> int:
    """Return the index at which another key can be added: before `...`, else at the end."""
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        if isinstance(event, yaml.DocumentEndEvent) and event.explicit and event.start_mark:
            return int(event.start_mark.index)
    return len(text)
