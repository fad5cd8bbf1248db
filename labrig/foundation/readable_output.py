"""Output in an encoding that lacks some of its characters: they are spelled, and nothing fails.

A redirected output on Windows is in a code page such as cp1252, that of `LC_ALL=C` may be ASCII.
There `σ = 2 s⁻¹` is printed as `sigma = 2 s^-1`.
"""

import codecs
import re
import sys
import unicodedata
from io import TextIOWrapper
from typing import Any

#: What each stands for where Unicode has no decomposition into plainer characters.
_SPELLINGS = {
    **{"µ": "u", "μ": "u", "λ": "lambda", "Λ": "Lambda"},  # Unicode's own name is "lamda"
    **{"±": "+-", "×": "x", "·": "*", "÷": "/", "−": "-", "⁄": "/", "√": "sqrt", "∞": "inf"},
    **{"≤": "<=", "≥": ">=", "≠": "!=", "≈": "~", "∝": "~", "∫": "integral", "∂": "d"},
    **{"→": "->", "←": "<-", "↔": "<->", "°": "deg", "′": "'", "″": '"', "‰": " per mille"},
    **{"‐": "-", "–": "-", "—": "-", "•": "*", "ß": "ss", "æ": "ae", "ø": "o", "Ø": "O"},
    **{"‘": "'", "’": "'", "“": '"', "”": '"', "„": '"', "«": '"', "»": '"'},
    **{"─": "-", "━": "-", "│": "|", "┃": "|", "╸": "-", "╺": "-"},
    **dict(zip("▁▂▃▄▅▆▇█▀", "_.,-=+*#^", strict=True)),
}
_SUFFIX = "_spelled"
#: A number in superscript is spelled as a whole, though Latin-1 has ¹, ² and ³.
_PART = re.compile("[¹²³\u2070-\u207f]+|[^\0-\x7f]")
#: Half of a surrogate pair by which Python stands for a byte of a file name that is no text.
_BYTES = range(0xDC80, 0xDD00)


def spelled(text: str, encoding: str, errors: str = "strict") -> str:
    r"""Return a text in which the characters that an encoding lacks are spelled.

    Parameters
    ----------
    text
        Any text.
    encoding
        Name of an encoding, such as `cp1252`.
    errors
        Error handler with which a character has to be encodable to be left as it is.

    Returns
    -------
    str
        Greek letters by their names, signs by what is typed for them, letters without their
        accents, all else by its number such as `\u6837`; text that the encoding has is unchanged.

    Examples
    --------
    >>> from labrig.foundation.readable_output import spelled
    >>> spelled("σ = (2 ± 1) s⁻¹", "cp1252"), spelled("χ² ≤ 1.2 · 10¹⁵", "ascii")
    ('sigma = (2 ± 1) s^-1', 'chi^2 <= 1.2 * 10^15')
    """

    def fits(part: str) -> bool:
        try:
            part.encode(encoding, errors)
        except UnicodeEncodeError:
            return False
        return True

    if fits(text):
        return text
    return _PART.sub(lambda part: part[0] if fits(part[0]) else _spelling(part[0]), text)


def make_streams_readable() -> None:
    """Make output and error stream spell what their encodings lack, and input take any bytes."""
    codecs.register(_codec)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # Paths that are no text pass unchanged where Python lets them, for scripts.
            errors = "surrogateescape" if stream.errors == "surrogateescape" else "strict"
            stream.reconfigure(encoding=f"{stream.encoding}{_SUFFIX}", errors=errors)
    if isinstance(sys.stdin, TextIOWrapper):
        sys.stdin.reconfigure(errors="backslashreplace")


def _spelling(part: str) -> str:
    """Return a superscript, or another character, in ASCII."""
    if part in _SPELLINGS:
        return _SPELLINGS[part]
    if ord(part[0]) in _BYTES:
        return f"\\x{ord(part) - 0xDC00:02x}"
    decomposed = unicodedata.normalize("NFKD", part)
    letters = (letter for letter in decomposed if not unicodedata.combining(letter))
    plain = "".join(letter if letter.isascii() else _named(letter) for letter in letters)
    if not plain.isascii():
        return part.encode("ascii", "backslashreplace").decode()
    is_superscript = unicodedata.decomposition(part[0]).startswith("<super>")
    return f"^{plain}" if is_superscript else plain


def _named(letter: str) -> str:
    """Return the spelling of a sign or the name of a Greek letter; any other letter itself."""
    if letter in _SPELLINGS:
        return _SPELLINGS[letter]
    match unicodedata.name(letter, "").split():
        case ["GREEK", "SMALL", "LETTER", *_, name]:
            return name.lower()
        case ["GREEK", "CAPITAL", "LETTER", *_, name]:
            return name.title()
    return letter


def _codec(name: str) -> codecs.CodecInfo | None:
    """Return the codec of an encoding's name with `_SUFFIX`, which spells what that one lacks.

    A codec rather than an error handler: what is before the character belongs to a superscript,
    too, and command line libraries write UTF-8 to a stream whose encoding is called ASCII.
    """
    if not name.endswith(_SUFFIX):
        return None
    encoding = name.removesuffix(_SUFFIX)
    plain = codecs.lookup(encoding)

    class Encoder(codecs.IncrementalEncoder):
        def __init__(self, errors: str = "strict") -> None:
            super().__init__(errors)
            self._plain = plain.incrementalencoder(errors)

        def encode(self, text: str, final: bool = False) -> bytes:
            return self._plain.encode(spelled(text, encoding, self.errors), final)

        def reset(self) -> None:
            self._plain.reset()

        def getstate(self) -> Any:
            return self._plain.getstate()

        def setstate(self, state: Any) -> None:
            self._plain.setstate(state)

    def encode(text: str, errors: str = "strict") -> tuple[bytes, int]:
        return spelled(text, encoding, errors).encode(encoding, errors), len(text)

    return codecs.CodecInfo(
        encode,
        plain.decode,
        plain.streamreader,
        plain.streamwriter,
        Encoder,
        plain.incrementaldecoder,
        name=name,
    )
