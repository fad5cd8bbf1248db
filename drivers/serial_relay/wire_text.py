r"""Bytes of commands and answers as a rig file writes them: `lamp on\r`, or `hex A0 01 01 A2`."""

import re
from dataclasses import dataclass

#: Beginning of a text that gives bytes in hexadecimal.
HEX = "hex "
_ESCAPES = {"r": "\r", "n": "\n", "t": "\t", "0": "\0", "\\": "\\"}
_ESCAPE = re.compile(r"\\(x[0-9A-Fa-f]{2}|.|\Z)", re.DOTALL)


@dataclass(frozen=True)
class WireText:
    """Bytes of a command or an answer.

    Attributes
    ----------
    content
        The bytes, without what ends a line.
    is_hex
        Whether they were given in hexadecimal, and are therefore complete as they stand.
    """

    content: bytes
    is_hex: bool


def wire_text(text: str) -> WireText:
    r"""Return the bytes that a text of a rig file stands for.

    Parameters
    ----------
    text
        One character a byte, with the escapes `\r`, `\n`, `\t`, `\0`, `\\` and `\xA0`; or `hex `
        and pairs of hexadecimal digits.

    Raises
    ------
    ValueError
        The text has another escape, a character that is no single byte, or no pairs of digits.
    """
    if text.startswith(HEX):
        return WireText(_hex_bytes(text), is_hex=True)
    characters = _ESCAPE.sub(lambda match: _escaped(match[1]), text)
    try:
        return WireText(characters.encode("latin-1"), is_hex=False)
    except UnicodeEncodeError as error:
        raise ValueError(
            f"expected characters that are one byte each, got {characters[error.start]!r}; write "
            r"its bytes as the board expects them, such as \xC2\xB5"
        ) from None


def _hex_bytes(text: str) -> bytes:
    try:
        content = bytes.fromhex(text.removeprefix(HEX))
    except ValueError:
        content = b""
    if not content:
        raise ValueError("expected pairs of hexadecimal digits, such as 'hex A0 01 01 A2'")
    return content


def _escaped(code: str) -> str:
    if len(code) == 3:
        return chr(int(code[1:], 16))
    if code not in _ESCAPES:
        raise ValueError(r"expected \r, \n, \t, \0, \\ or two hexadecimal digits as in \xA0")
    return _ESCAPES[code]
