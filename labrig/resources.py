"""The files that are shipped with labrig: protocols, rigs, materials, optical data."""

import os
from pathlib import Path

from labrig.errors import UsageError
from labrig.yaml_file import did_you_mean

_PACKAGE = Path(__file__).parent
#: What names stand for: a YAML file, or measured curves in JSON.
SUFFIXES = (".yaml", ".yml", ".json")


def folder(name: str) -> Path:
    """Path of a shipped folder: `config`, `protocols`, …"""
    return (_PACKAGE / name).resolve()


def find(place: str, kind: str, name_or_path: str | os.PathLike[str]) -> Path:
    """File of a shipped name (`decay`, `sim`, `blue-paint`), or the path as given.

    A bare word is always a shipped name, whatever lies in the current folder; a file of one's own
    has its suffix or a folder before it.

    Parameters
    ----------
    place
        Shipped folder where such names live, such as `config/materials`.
    kind
        What to call it in messages: `material`.

    Raises
    ------
    UsageError
        Neither a shipped name nor a file.
    """
    given = Path(name_or_path)
    if given.suffix in SUFFIXES or len(given.parts) > 1:
        if not given.is_file():
            raise UsageError(f"{given}: no such {kind} file")
        return given
    known = names(place)
    if str(given) not in known:
        suffix = next(iter(known.values())).suffix
        raise UsageError(
            f"no shipped {kind} is called '{given}' (a file of your own is given with its suffix, "
            f"such as {given}{suffix}); {did_you_mean(str(given), list(known))}"
        )
    return known[str(given)]


def names(place: str) -> dict[str, Path]:
    """Name → file of all that is shipped in a folder, sorted."""
    files = (path for path in folder(place).iterdir() if path.suffix in SUFFIXES)
    return {path.stem: path for path in sorted(files)}
