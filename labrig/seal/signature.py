"""Signatures by Ed25519 in OpenSSH's format, and the public keys of those who sign.

`ssh-keygen -Y verify` checks them, too. The format is that of PROTOCOL.sshsig of OpenSSH: lengths
of four bytes before each text, the signer's public key within the signature, and a namespace, so
that a signature made for something else, such as a commit, is none of a run.
"""

import binascii
import hashlib
import re
import shlex
import struct
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import wrap

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.input_file import read_text

#: Purpose of a signature of labrig, `-n` of ssh-keygen.
NAMESPACE = "labrig-run"
#: Name of the only kind of key.
ED25519 = "ssh-ed25519"
_MAGIC, _VERSION = b"SSHSIG", struct.pack(">I", 1)
_HASHES = {b"sha256": hashlib.sha256, b"sha512": hashlib.sha512}
_BEGIN, _END = "-----BEGIN SSH SIGNATURE-----", "-----END SSH SIGNATURE-----"
_KEY_BYTES = 32
_LINE = 70


@dataclass(frozen=True)
class PublicKey:
    """A public key by which signatures are checked.

    Attributes
    ----------
    raw
        The 32 bytes of the key.
    """

    raw: bytes

    @property
    def line(self) -> str:
        """The key as in a `.pub` file, without a name."""
        return f"{ED25519} {b64encode(self._blob).decode()}"

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the key, as `ssh-keygen -l` prints it."""
        digest = b64encode(hashlib.sha256(self._blob).digest()).decode().rstrip("=")
        return f"SHA256:{digest}"

    @property
    def _blob(self) -> bytes:
        return _text(ED25519.encode()) + _text(self.raw)

    @classmethod
    def of(cls, key: Ed25519PublicKey) -> "PublicKey":
        """Return the value of a key of the library."""
        return cls(key.public_bytes(Encoding.Raw, PublicFormat.Raw))

    @classmethod
    def parse(cls, blob: bytes) -> "PublicKey":
        """Return the key in OpenSSH's binary form.

        Raises
        ------
        ValueError
            It is of another kind, or malformed.
        """
        kind, raw, *more = _texts(blob)
        if kind != ED25519.encode() or len(raw) != _KEY_BYTES or more:
            raise ValueError(f"expected a key of the kind {ED25519}")
        return cls(raw)


def signature_text(message: bytes, key: Ed25519PrivateKey) -> str:
    """Return the signature of a message.

    Parameters
    ----------
    message
        Bytes that are signed.
    key
        Private key of the signer.

    Returns
    -------
    str
        Signature in OpenSSH's armour, with the public key in it.

    Examples
    --------
    >>> from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    >>> from labrig.seal import signature_text
    >>> text = signature_text(b"numbers", Ed25519PrivateKey.generate())
    >>> text.splitlines()[0]
    '-----BEGIN SSH SIGNATURE-----'
    """
    signature = key.sign(_signed(message, b"sha512"))
    content = b"".join(
        [
            _MAGIC,
            _VERSION,
            _text(PublicKey.of(key.public_key())._blob),
            _text(NAMESPACE.encode()),
            _text(b""),
            _text(b"sha512"),
            _text(_text(ED25519.encode()) + _text(signature)),
        ]
    )
    return "\n".join([_BEGIN, *wrap(b64encode(content).decode(), _LINE), _END, ""])


def signer_of(message: bytes, signature: str) -> PublicKey:
    """Return the key by which a message was signed.

    Parameters
    ----------
    message
        Bytes that were signed.
    signature
        Signature in OpenSSH's armour.

    Returns
    -------
    PublicKey
        Key in the signature. Who has it, the caller has to know.

    Raises
    ------
    DataError
        The signature is malformed, of another kind or purpose, or not of this message.

    Examples
    --------
    >>> from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    >>> from labrig.seal import signature_text, signer_of
    >>> text = signature_text(b"numbers", Ed25519PrivateKey.generate())
    >>> signer_of(b"numbers", text).fingerprint[:7]
    'SHA256:'
    >>> signer_of(b"other numbers", text)
    Traceback (most recent call last):
        ...
    labrig.foundation.errors.DataError: the signature is not of this list: one of both was changed
    """
    try:
        key, hash_name, raw = _parse(signature)
        public = Ed25519PublicKey.from_public_bytes(key.raw)
    except (ValueError, binascii.Error, struct.error) as error:
        raise DataError(
            f"expected a signature by {ED25519} for '{NAMESPACE}' in OpenSSH's format, got another "
            f"text ({error})"
        ) from None
    try:
        public.verify(raw, _signed(message, hash_name))
    except InvalidSignature:
        raise DataError("the signature is not of this list: one of both was changed") from None
    return key


def _parse(signature: str) -> tuple[PublicKey, bytes, bytes]:
    """Return key, name of the hash, and signature proper."""
    begin, *text, end = [" ".join(line.split()) for line in signature.strip().splitlines()]
    if (begin, end) != (_BEGIN, _END):
        raise ValueError("no armour")
    content = b64decode("".join(text), validate=True)
    head = _MAGIC + _VERSION
    if not content.startswith(head):
        raise ValueError("another version")
    blob, namespace, _, hash_name, signed, *more = _texts(content[len(head) :])
    if namespace != NAMESPACE.encode():
        raise ValueError(f"made for '{namespace.decode('ascii', 'replace')[:40]}'")
    kind, raw, *rest = _texts(signed)
    if kind != ED25519.encode() or hash_name not in _HASHES or more or rest:
        raise ValueError("another kind of signature")
    return PublicKey.parse(blob), hash_name, raw


def _signed(message: bytes, hash_name: bytes) -> bytes:
    """Return what is signed for a message: its hash with the purpose."""
    digest = _HASHES[hash_name](message).digest()
    return _MAGIC + _text(NAMESPACE.encode()) + _text(b"") + _text(hash_name) + _text(digest)


def _text(content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + content


def _texts(content: bytes) -> list[bytes]:
    """Split a sequence of texts, each after its length."""
    texts = []
    while content:
        (length,) = struct.unpack_from(">I", content)
        if len(content) < 4 + length:
            raise ValueError("cut off")
        texts.append(content[4 : 4 + length])
        content = content[4 + length :]
    return texts


_MAX_BYTES = 1_000_000
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
    for number, line in enumerate(read_text(path, _MAX_BYTES).splitlines(), start=1):
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
