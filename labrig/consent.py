"""Consent to what a rig file asks for beyond its bench: programs, and connections over a network.

A file of somebody else starts no program and calls no other computer by itself. This user consents
to each such deed on this PC, by the sentence that describes it, word for word.
"""

import hashlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from labrig.foundation.errors import LabrigError, UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.output_file import make_folder, write_text
from labrig.foundation.user_folder import settings_file

#: Schemes of the addresses that lead to a network; what opens addresses takes no others there.
NETWORK_SCHEMES = ("ptpip", "socket", "tcp", "http", "https", "rtsp")


def starting(command: Sequence[str]) -> str:
    """Return the sentence about the start of a command, in plain ASCII."""
    return f"starts {' '.join(map(ascii, command))}"


def calls(addresses: Iterable[str]) -> tuple[str, ...]:
    """Return a sentence for each of the addresses that lead to a network."""
    return tuple(
        f"connects to {address!a}"
        for address in addresses
        if address.partition("://")[0].lower() in NETWORK_SCHEMES
    )


def has_consent(sentence: str) -> bool:
    """Return whether this user consented to a deed, word for word, on this PC."""
    return _digest(sentence) in _given()


def give_consent(sentences: Iterable[str]) -> None:
    """Remember that this user consented to deeds.

    Raises
    ------
    DiskError
        It cannot be written down.
    """
    file = _file()
    digests = sorted({*_given(), *map(_digest, sentences)})
    make_folder(file.parent)
    write_text(file, "".join(f"{digest}\n" for digest in digests))


def require_consent(sentences: Iterable[str], source: str) -> None:
    """Refuse a deed of the rig file `source` to which this user did not consent.

    Raises
    ------
    UsageError
        There is no consent; the message says how it is given.
    """
    for sentence in sentences:
        if not has_consent(sentence):
            raise UsageError(
                f"{source} {sentence}, which needs your consent, in case somebody else wrote it: "
                "labrig rig use FILE"
            )


def _digest(sentence: str) -> str:
    return hashlib.sha256(sentence.encode()).hexdigest()


def _given() -> set[str]:
    with suppress(LabrigError):
        return set(read_text(_file()).split())
    return set()


def _file() -> Path:
    return settings_file("consents.txt")
