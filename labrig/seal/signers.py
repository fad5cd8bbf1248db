"""Laboratories by their public keys, as in a `.pub` file or in OpenSSH's allowed signers."""

import binascii
import re
import shlex
from base64 import b64decode
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.seal.signature import ED25519, NAMESPACE, PublicKey

_MOST_BYTES = 1_000_000
_NAMESPACES = re.compile(r'namespaces="([^"]*)"', re.IGNORECASE)


@dataclass(frozen=True)
class Signers:
    """Names of laboratories by their public keys.

    Attributes
    ----------
    names
        Name by public key.
    """

    names: Mapping[PublicKey, str] = field(default_factory=dict)

    def name_of(self, key: PublicKey) -> str | None:
        """Return the name that belongs to a key; None for an unknown key."""
        return self.names.get(key)

    def text(self) -> str:
        """Return the file of these keys, one a line."""
        return "".join(f"{key.line} {name}\n" for key, name in self.names.items())

    def __or__(self, other: "Signers") -> "Signers":
        """Return the signers of both; names of the second one have priority."""
        return Signers({**self.names, **other.names})


def read_signers(path: Path) -> Signers:
    """Read a file with public keys.

    Parameters
    ----------
    path
        File of a public key (`ssh-ed25519 KEY NAME`), several of these, or OpenSSH's allowed
        signers (`NAME namespaces="labrig-run" ssh-ed25519 KEY`). Keys of other kinds, and keys for
        other purposes, are passed over.

    Returns
    -------
    Signers
        Name by key.

    Raises
    ------
    UsageError
        The file cannot be read, a line is malformed or has another option, or no key is left.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.seal import create_key, read_signers
    >>> key = create_key(Path("settings/key"), "Example lab")
    >>> read_signers(Path("settings/key.pub")).name_of(key.public)
    'Example lab'
    """
    names: dict[PublicKey, str] = {}
    for number, line in enumerate(read_text(path, _MOST_BYTES).splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            names |= _signer(line)
        except (ValueError, binascii.Error) as error:
            raise UsageError(
                f"{path}, line {number}: expected '{ED25519} KEY NAME' or 'NAME {ED25519} KEY', "
                f"got {line[:60]!r} ({error})"
            ) from None
    if not names:
        raise UsageError(f"{path}: expected public keys of the kind {ED25519}, got none")
    return Signers(names)


def _signer(line: str) -> dict[PublicKey, str]:
    """Return the key of a line with its name; none for a key of another kind or purpose."""
    words = line.split()
    kinds = [n for n, word in enumerate(words) if re.fullmatch(r"(sk-)?(ssh|ecdsa)-[\w@.-]+", word)]
    if not kinds or len(words) < kinds[0] + 2:
        raise ValueError("no public key")
    place = kinds[0]
    before, kind, key, comment = words[:place], words[place], words[place + 1], words[place + 2 :]
    if kind != ED25519:
        return {}
    if not before:
        name = " ".join(comment) or "unnamed"
    else:
        before = shlex.split(" ".join(before), posix=False)
        name, options = before[0].strip('"'), ",".join(before[1:])
        rest = _NAMESPACES.sub("", options).strip(",")
        if rest:
            raise ValueError(f"the option {rest[:40]} is not supported")
        namespaces = _NAMESPACES.search(options)
        if namespaces and NAMESPACE not in namespaces[1].split(","):
            return {}
        name = " ".join(comment) or name
    if not name.isprintable():
        raise ValueError("the name has characters that cannot be printed")
    return {PublicKey.parse(b64decode(key, validate=True)): name}
