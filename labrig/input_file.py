"""Reading of input files, with messages that name the problem."""

import codecs
import errno
from pathlib import Path

from labrig.errors import DiskError, UsageError

#: Errors of the disk, which no other name and no permission would resolve.
DISK_ERRORS = {errno.EIO, errno.ENODEV, errno.ENXIO, errno.ESTALE, errno.ETIMEDOUT}

#: Limit that a table of a year's measurements does not reach, but `/dev/zero` does.
MAX_TEXT_BYTES = 50_000_000


def read_bytes(path: Path, most_bytes: int) -> bytes:
    """Read the bytes of the file at `path`.

    Raises
    ------
    UsageError
        There is no readable file, or it has more than `most_bytes`.
    DiskError
        The disk cannot be read.
    """
    try:
        with path.open("rb") as file:
            content = file.read(most_bytes + 1)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except OSError as error:
        error_class = DiskError if error.errno in DISK_ERRORS else UsageError
        raise error_class(f"{path}: cannot be read ({error.strerror})") from None
    if len(content) > most_bytes:
        raise UsageError(f"{path}: expected a file of at most {most_bytes} bytes, got more")
    return content


def read_text(path: Path, most_bytes: int = MAX_TEXT_BYTES) -> str:
    """Read the text in the file at `path`, without a byte-order mark.

    Raises
    ------
    UsageError, DiskError
        The file is refused by `read_bytes`, or it is not text in UTF-8.
    """
    try:
        return read_bytes(path, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: not text in UTF-8 ({error}); save it as UTF-8") from None


#: First bytes of a workbook: of a zip archive (Excel, OpenDocument), of an older Excel file.
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")


def read_table_text(path: Path) -> str:
    """Read the text of another program's table, in UTF-8, UTF-16 or Windows-1252.

    Raises
    ------
    UsageError, DiskError
        The file is refused by `read_bytes`, is a workbook, or is no text.
    """
    content = read_bytes(path, MAX_TEXT_BYTES)
    if content.startswith(_WORKBOOKS):
        raise UsageError(f"{path}: a workbook, not a text; save the sheet as CSV (UTF-8)")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings = ["utf-16"]
    else:
        # A text has no zero bytes; without this test almost any file is text in Windows-1252.
        encodings = ["utf-8-sig", *([] if b"\0" in content else ["cp1252"])]
    for encoding in encodings:
        try:
            return content.decode(encoding)
        except UnicodeDecodeError as error:
            reason = error
    raise UsageError(f"{path}: not text in UTF-8 ({reason}); save it as UTF-8")
