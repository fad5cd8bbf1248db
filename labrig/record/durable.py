"""Files that are either whole or not there."""

import os
from contextlib import suppress
from pathlib import Path

from labrig.errors import DiskError
from labrig.record.disk import REAL_DISK, Disk


def write_durably(path: Path, data: bytes, disk: Disk = REAL_DISK) -> None:
    """Write `data` to `path` by way of `.part`, on the disk before the name appears.

    Raises
    ------
    DiskError
        The disk is full or gone; nothing named `path` is left.
    """
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb", buffering=0) as file:
            disk.write(file, data)
        part.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise DiskError(
            f"{path}: {len(data) / 1e6:.2g} MB cannot be written ({error.strerror}); make room"
        ) from None


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable, where the system has a way to (Windows has none)."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
