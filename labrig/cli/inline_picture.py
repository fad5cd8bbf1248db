"""Pictures among the lines of a terminal that shows some: kitty's and iTerm2's protocols.

https://sw.kovidgoyal.net/kitty/graphics-protocol/ and https://iterm2.com/documentation-images.html
"""

import os
import sys
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from labrig.catalogue import RunSummary

#: Size of a picture in cells of the terminal, about 4:3.
COLUMNS, ROWS = 10, 4
#: Largest file that is shown.
MAX_BYTES = 1_000_000
#: Bytes of a picture in one of kitty's sequences.
CHUNK = 4096
PNG = b"\x89PNG\r\n\x1a\n"

#: Terminals that show pictures, by their own names in TERM, which SSH passes on, and TERM_PROGRAM.
_KITTY_TERMS = {"xterm-kitty", "xterm-ghostty"}
_ITERM_PROGRAMS = {"iTerm.app", "WezTerm", "mintty"}


@dataclass(frozen=True)
class InlinePictures:
    """Writer of pictures for the terminal at hand.

    Attributes
    ----------
    sequence
        Function that returns the escape sequence of a PNG file's content.
    """

    sequence: Callable[[bytes], str]

    @classmethod
    def of_terminal(cls, environment: Mapping[str, str] = os.environ) -> Self | None:
        """Return the writer for standard output; None unless its terminal says it shows pictures.

        Within tmux and screen there is none: they show no picture, whatever is around them.
        """
        if not sys.stdout.isatty() or "TMUX" in environment or "STY" in environment:
            return None
        program = environment.get("TERM_PROGRAM", "")
        if environment.get("TERM") in _KITTY_TERMS:
            return cls(_kitty)
        if program in _ITERM_PROGRAMS or environment.get("LC_TERMINAL") == "iTerm2":
            return cls(_iterm)
        return None

    def of(self, runs: Sequence["RunSummary"]) -> str:
        """Return the latest picture of a sample with room for it, the cursor left where it began.

        It is empty if no run has one.
        """
        from labrig.foundation.errors import LabrigError
        from labrig.foundation.input_file import read_bytes
        from labrig.results import SAMPLE_PICTURE

        for run in reversed(runs):
            path = run.folder / "result" / SAMPLE_PICTURE
            if not path.is_file():
                continue
            try:
                content = read_bytes(path, MAX_BYTES)
            except LabrigError:
                continue
            if content.startswith(PNG):
                # Lines for the picture first: one that begins at the lower edge would scroll away.
                room = "\n" * ROWS + f"\x1b[{ROWS}A"
                return f"{room}\x1b7{self.sequence(content)}\x1b8"
        return ""


def _iterm(png: bytes) -> str:
    size = f"size={len(png)};width={COLUMNS};height={ROWS};preserveAspectRatio=1"
    return f"\x1b]1337;File=inline=1;{size}:{b64encode(png).decode()}\x07"


def _kitty(png: bytes) -> str:
    text = b64encode(png).decode()
    parts = [text[at : at + CHUNK] for at in range(0, len(text), CHUNK)]
    # a=T: transmit and show, f=100: PNG, C=1: the cursor stays, q=2: no answer.
    first = f"a=T,f=100,C=1,q=2,c={COLUMNS},r={ROWS},"
    return "".join(
        f"\x1b_G{'' if number else first}m={int(number < len(parts) - 1)};{part}\x1b\\"
        for number, part in enumerate(parts)
    )
