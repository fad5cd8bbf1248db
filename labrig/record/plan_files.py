"""Files of a run that say what was asked, as the journal has them, and what was edited since.

The RunStart of the first attempt holds their texts, so that the journal's seals cover them. Files
that were edited since have no influence unless a person asks for them.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from labrig.foundation.errors import LabrigError
from labrig.foundation.input_file import MAX_JOURNAL_BYTES, MAX_TEXT_BYTES, read_bytes, read_text
from labrig.record.journal import JOURNAL

#: Key of the RunStart with the texts; a later one, of edits that were taken over, replaces it.
FILES = "files"
#: Names of the files by their keys in the journal, in which no key has a point.
PLAN_FILES = {
    "protocol": "protocol.yaml",
    "rig": "rig.yaml",
    "calibrations": "calibrations.yaml",
}
#: Largest number of edited keys that are named.
MAX_KEYS = 20


def plan_texts(run: Path) -> dict[str, str]:
    """Return the texts of the files as they lie in a run folder, by their keys in the journal."""
    return {
        key: read_text(run / name, MAX_TEXT_BYTES)
        for key, name in PLAN_FILES.items()
        if (run / name).is_file()
    }


def files_bytes(texts: Mapping[str, str]) -> int:
    """Return the number of bytes that the texts take in the line of a RunStart."""
    return len(f', "{FILES}": {json.dumps(texts, ensure_ascii=False)}'.encode())


def journal_text(run: Path, name: str) -> str | None:
    """Return the text of one of the files as a run's journal has it.

    Parameters
    ----------
    run
        Run folder.
    name
        Name of the file: `protocol.yaml`, `rig.yaml` or `calibrations.yaml`.

    Returns
    -------
    str or None
        The text; None if nothing was recorded yet, or the journal does not have the file.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import journal_text
    >>> journal_text(Path("runs/decay"), "notes.md") is None
    True
    """
    return _journal_texts(run).get(name)


def plan_content(run: Path, name: str) -> dict[str, Any]:
    """Return the content of one of the files as the journal has it, else as it lies in the folder.

    Parameters
    ----------
    run
        Run folder.
    name
        Name of the file, such as `protocol.yaml`.

    Returns
    -------
    dict
        Content as YAML loads it.

    Raises
    ------
    UsageError
        There is no such file, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import plan_content
    >>> plan_content(Path("runs/decay"), "protocol.yaml")["protocol"]
    'decay'
    """
    from labrig.foundation.yaml_file import parse_yaml, read_yaml  # not for a list of runs

    text = journal_text(run, name)
    return read_yaml(run / name) if text is None else parse_yaml(text, str(run / name))


def _journal_texts(run: Path) -> dict[str, str]:
    texts: dict[str, Any] = {}
    try:
        content = read_bytes(run / JOURNAL, MAX_JOURNAL_BYTES)
    except LabrigError:
        return {}
    for line in content.splitlines():
        if line.startswith(b'{"name": "start"') and f'"{FILES}": {{'.encode() in line:
            try:
                texts = dict(json.loads(line)["doc"][FILES])
            except (ValueError, KeyError, TypeError, RecursionError):
                continue  # the journal's reader says so
    named = {PLAN_FILES[key]: text for key, text in texts.items() if key in PLAN_FILES}
    return {name: text for name, text in named.items() if isinstance(text, str)}


def edited_keys(run: Path) -> tuple[str, ...]:
    """Return what the files of a run folder say otherwise than its journal.

    Parameters
    ----------
    run
        Run folder.

    Returns
    -------
    tuple of str
        A line for each key, with the value in the journal and in the file; none if nothing was
        edited, or the journal does not have the files.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import edited_keys
    >>> edited_keys(Path("runs/decay"))
    ()
    """
    lines = [
        line for name, text in _journal_texts(run).items() for line in _edits(run / name, text)
    ]
    more = len(lines) - MAX_KEYS
    return (*lines[:MAX_KEYS], *([f"{more} more keys were edited"] if more > 0 else []))


def _edits(path: Path, text: str) -> Iterator[str]:
    """Yield a line for each key in which a file differs from its text in the journal."""
    from labrig.foundation.yaml_file import parse_yaml  # not for a list of runs

    if not path.is_file():
        yield f"{path.name} is missing"
        return
    try:
        if (now := read_text(path, MAX_TEXT_BYTES)) == text:
            return
        before, after = (dict(_flat(parse_yaml(each, str(path)), "")) for each in (text, now))
    except LabrigError as error:
        yield str(error)
        return
    for key in dict.fromkeys([*before, *after]):
        if before.get(key) != after.get(key):
            old, new = (_shown(each, key) for each in (before, after))
            yield f"{path.name} was edited: {key} is {new}, in the journal {old}"


def _flat(content: Any, place: str) -> Iterator[tuple[str, Any]]:
    """Yield each value of a file's content by its dotted key."""
    if isinstance(content, Mapping) and content:
        for key, value in content.items():
            yield from _flat(value, f"{place}.{key}" if place else str(key))
    else:
        yield place, content


def _shown(values: Mapping[str, Any], key: str) -> str:
    if key not in values:
        return "not there"
    value = values[key]
    return f"'{value}'" if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
