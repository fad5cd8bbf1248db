"""The key of a laboratory: created once, in this user's own folder, readable by nobody else."""

import os
import stat
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_ssh_private_key,
)

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import open_regular, read_text
from labrig.foundation.output_file import write_private, write_text
from labrig.seal.signature import ED25519, PublicKey

_MAX_BYTES = 100_000
#: Longest name of a laboratory.
_MAX_NAME = 80


@dataclass(frozen=True)
class LabKey:
    """A private key with the name of the laboratory whose it is.

    Attributes
    ----------
    name
        Name of the laboratory.
    private
        Key that signs; it is not printed.
    """

    name: str
    private: Ed25519PrivateKey = field(repr=False)

    @property
    def public(self) -> PublicKey:
        """The key by which others check signatures."""
        return PublicKey.of(self.private.public_key())

    @property
    def public_line(self) -> str:
        """Content of the file with the public key, in one line with the name."""
        return f"{self.public.line} {self.name}"


def public_file(path: Path) -> Path:
    """Return the file of the public key beside that of a private one.

    Parameters
    ----------
    path
        File of the private key.

    Returns
    -------
    Path
        File of the public key, which may not exist.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.seal import public_file
    >>> public_file(Path("settings/seal_key")).name
    'seal_key.pub'
    """
    return path.with_name(f"{path.name}.pub")


def create_key(path: Path, name: str) -> LabKey:
    """Create a key, and write it so that this user alone can read it.

    Parameters
    ----------
    path
        File of the private key; the public one is written beside it, with the ending `.pub`.
    name
        Name of the laboratory, in one line of at most 80 characters.

    Returns
    -------
    LabKey
        The new key.

    Raises
    ------
    UsageError
        There is a key already, or the name is none.
    DiskError
        The files cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.seal import create_key
    >>> key = create_key(Path("settings/seal_key"), "Optics lab, Example University")
    >>> key.public_line.split()[0], key.public_line.split()[2:]
    ('ssh-ed25519', ['Optics', 'lab,', 'Example', 'University'])
    """
    name = " ".join(name.split())
    if not name or not name.isprintable() or len(name) > _MAX_NAME:
        raise UsageError(
            f"expected the name of a laboratory in at most {_MAX_NAME} characters, got {name!r}"
        )
    key = LabKey(name, Ed25519PrivateKey.generate())
    content = key.private.private_bytes(Encoding.PEM, PrivateFormat.OpenSSH, NoEncryption())
    try:
        write_private(path, content)
    except FileExistsError:
        raise UsageError(
            f"{path}: there is a key already; signatures by it are checked by its public key "
            "(labrig key show). Move it away to make another one"
        ) from None
    write_text(public_file(path), f"{key.public_line}\n")
    return key


def read_key(path: Path) -> LabKey:
    """Read a private key of the kind Ed25519, as labrig or `ssh-keygen` writes it.

    Parameters
    ----------
    path
        File of the private key; the name is that of the public key beside it.

    Returns
    -------
    LabKey
        The key, named `unnamed` if there is no public key beside it.

    Raises
    ------
    UsageError
        There is no such key, others can read it, it has a passphrase, or it is of another kind.
    DiskError
        The disk does not give it back.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.seal import create_key, read_key
    >>> created = create_key(Path("settings/lab"), "Example lab")
    >>> read_key(Path("settings/lab")).public == created.public
    True
    """
    with open_regular(path) as file:
        mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
        content = file.read(_MAX_BYTES)
    if os.name != "nt" and mode & 0o077:
        raise UsageError(
            f"{path}: expected a key that nobody else can read, got one of mode {mode:o}; if "
            f"nobody has copied it: chmod 600 {path}, else make another one"
        )
    try:
        private = load_ssh_private_key(content, None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise UsageError(
            f"{path}: expected a private key of OpenSSH without passphrase, got another file "
            f"({error})"
        ) from None
    if not isinstance(private, Ed25519PrivateKey):
        raise UsageError(f"{path}: expected a key of the kind {ED25519}, got another kind")
    return LabKey(_name_beside(path), private)


def _name_beside(path: Path) -> str:
    """Return the name in the file with the public key."""
    with suppress(UsageError):
        words = read_text(public_file(path), _MAX_BYTES).split(maxsplit=2)
        name = " ".join(words[2].split()) if len(words) > 2 else ""
        if name and name.isprintable():
            return name[:_MAX_NAME]
    return "unnamed"
