"""Text of another program's file, whatever its encoding."""

import codecs
import re
from pathlib import Path

from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import CURVES, TABLE, require_kind
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes

#: Limit of the lines, above those of a year with a reading each minute: each takes memory and time.
MAX_LINES = 600_000
#: First bytes of a workbook: of a zip archive (Excel, OpenDocument), of an older Excel file.
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
#: Control characters that stand in no text.
_NOT_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
#: What programs of DOS write after the end of a text.
_END = b"\x1a\x00"


def read_table_text(path: Path) -> str:
    r"""Read the text of another program's table, in UTF-8, UTF-16, Windows-1252 or Latin-1.

    Parameters
    ----------
    path
        Path of the file.

    Returns
    -------
    str
        The text, without a byte-order mark.

    Raises
    ------
    UsageError, DiskError
        The file is refused by `read_bytes`, is a workbook, too long, or no text.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.text_table import read_table_text
    >>> _ = Path("decay.txt").write_bytes("t/µs\tI\n0\t5\n".encode("utf-16"))
    >>> read_table_text(Path("decay.txt"))
    't/µs\tI\n0\t5\n'
    """
    require_kind(path, TABLE, CURVES)
    content = read_bytes(path, MAX_TEXT_BYTES)
    if content.startswith(_WORKBOOKS):
        raise UsageError(f"{path}: a workbook, not a text; save the sheet as CSV (UTF-8)")
    lines = max(content.count(b"\n"), content.count(b"\r"))
    if lines > MAX_LINES:
        raise UsageError(
            f"{path}: expected a table of at most {MAX_LINES} lines, got {lines}; leave rows out, "
            "or average them"
        )
    for encoding in _encodings(content):
        try:
            return content.rstrip(_END if "16" not in encoding else b"").decode(encoding)
        except UnicodeDecodeError as error:
            reason = error
    raise UsageError(f"{path}: not text in UTF-8 ({reason}); save it as UTF-8")


def _encodings(content: bytes) -> list[str]:
    """Return the encodings that a text may have, the likeliest first."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return ["utf-16"]
    # Every second byte of Latin letters and digits in UTF-16 is zero, and none of other encodings.
    high, low = content[0:400:2], content[1:400:2]
    if len(content) % 2 == 0 and low.count(0) > len(low) / 2 and not high.count(0):
        return ["utf-16-le"]
    if len(content) % 2 == 0 and high.count(0) > len(high) / 2 and not low.count(0):
        return ["utf-16-be"]
    # Without this test almost any file is text in Windows-1252, and any in Latin-1.
    is_text = _NOT_TEXT.search(content.rstrip(_END)) is None
    return ["utf-8-sig", *(["cp1252", "latin-1"] if is_text else [])]
