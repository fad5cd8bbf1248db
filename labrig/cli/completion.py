"""Completion by the shell: names of protocols, rigs, materials, scenes and runs.

No file is opened, since a person waits for the answer; an unreadable folder has no names.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parents[1]


def complete_protocol(incomplete: str) -> list[str]:
    """Return the shipped protocols that begin so."""
    return [name for name in _shipped("protocols", "*/*.yaml") if name.startswith(incomplete)]


def complete_rig(incomplete: str) -> list[str]:
    """Return the shipped rigs that begin so."""
    return [name for name in _shipped("config") if name.startswith(incomplete)]


def complete_material(incomplete: str) -> list[str]:
    """Return the shipped phosphors that begin so."""
    return [name for name in _shipped("config/materials") if name.startswith(incomplete)]


def complete_scene(incomplete: str) -> list[str]:
    """Return the shipped scenes that begin so."""
    return [name for name in _shipped("config/scenes") if name.startswith(incomplete)]


def complete_run(ctx: Any, incomplete: str) -> list[str]:
    """Return the names of the runs that begin so, in the folder given by `--runs`."""
    runs = Path(ctx.params.get("runs") or "runs")
    names = ["last", *sorted(_folders(runs), reverse=True)]
    return [name for name in names if name.startswith(incomplete)]


def _shipped(place: str, pattern: str = "*.yaml") -> list[str]:
    try:
        return sorted(path.stem for path in (_PACKAGE / place).glob(pattern))
    except OSError:
        return []


def _folders(runs: Path) -> Iterator[str]:
    try:
        with os.scandir(runs) as entries:
            yield from (entry.name for entry in entries if entry.is_dir())
    except OSError:
        return
