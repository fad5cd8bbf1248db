"""Journals that somebody forged: changed, and sealed again line by line."""

import json
from hashlib import sha256
from pathlib import Path

from labrig.record import sealed_line


def reseal(journal: Path) -> None:
    """Seal the lines of a journal as they are now; what is no document stays."""
    content = journal.read_bytes()
    lines, seal = [], ""
    for line in content.splitlines():
        try:
            document = json.loads(line)
            sealed = sealed_line(document["name"], document["doc"], seal).removesuffix(b"\n")
        except (ValueError, KeyError, TypeError):
            sealed = line
        lines.append(sealed)
        seal = sha256(sealed).hexdigest()
    journal.write_bytes(b"\n".join(lines) + (b"\n" if content.endswith(b"\n") else b""))
