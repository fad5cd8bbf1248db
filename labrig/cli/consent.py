"""Consent to commands in rig files: a file of somebody else starts no program by itself."""

import hashlib
import json
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import typer

from labrig.errors import DiskError
from labrig.record import write_durably


def has_consent(command: Sequence[str]) -> bool:
    """Return whether this user consented to a command, word for word, on this PC."""
    return _digest(command) in _given()


def give_consent(command: Sequence[str]) -> None:
    """Remember that this user consented to a command.

    Raises
    ------
    DiskError
        It cannot be written down.
    """
    file = _file()
    digests = sorted({*_given(), _digest(command)})
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DiskError(f"{file.parent}: cannot be made ({error.strerror})") from None
    write_durably(file, "".join(f"{digest}\n" for digest in digests).encode())


def command_text(command: Sequence[str]) -> str:
    """Return a command on one line, in plain ASCII."""
    return " ".join(map(ascii, command))


def _digest(command: Sequence[str]) -> str:
    return hashlib.sha256(json.dumps(list(command)).encode()).hexdigest()


def _given() -> set[str]:
    with suppress(OSError):
        return set(os.fsdecode(_file().read_bytes()).split())
    return set()


def _file() -> Path:
    return Path(typer.get_app_dir("labrig")) / "consents.txt"
