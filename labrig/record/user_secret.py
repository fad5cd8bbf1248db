"""Digests that only this user on this PC can make, for what is kept in a run folder.

What was reduced from frames lies in the run folder, which may come from somebody else. A digest
with a secret of this user shows that this user's own labrig has written it.
"""

import hmac
import os
import secrets
import stat
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

from labrig.foundation.errors import DiskError, LabrigError
from labrig.foundation.input_file import open_regular
from labrig.foundation.output_file import write_private

_FOLDER, _FILE = "labrig", "kept_numbers_key"
_BYTES = 32


def own_digest(content: bytes) -> str:
    """Return the HMAC-SHA256 of a content by the secret of this user.

    Parameters
    ----------
    content
        Content of a file.

    Returns
    -------
    str
        Digest in hexadecimal digits. Where no secret can be kept, it is another one in each
        process.

    Examples
    --------
    >>> from labrig.record import own_digest
    >>> own_digest(b"numbers") == own_digest(b"numbers"), len(own_digest(b""))
    (True, 64)
    """
    return hmac.new(_secret(), content, sha256).hexdigest()


@cache
def _secret() -> bytes:
    """Return the secret of this user, which is made when it is first asked for."""
    from platformdirs import user_cache_path

    file = user_cache_path(_FOLDER, appauthor=False) / _FILE
    with suppress(FileExistsError, DiskError):
        write_private(file, secrets.token_bytes(_BYTES))
    return _read(file) or secrets.token_bytes(_BYTES)


def _read(file: Path) -> bytes | None:
    """Return the secret in a file that this user alone can read; None if it is none."""
    with suppress(OSError, LabrigError), open_regular(file) as opened:
        status = os.fstat(opened.fileno())
        is_own = os.name == "nt" or (
            status.st_uid == os.getuid() and not stat.S_IMODE(status.st_mode) & 0o077
        )
        content = opened.read(_BYTES + 1)
        if is_own and len(content) == _BYTES:
            return content
    return None
