r"""Keys that describe a board on a serial line: the line, its commands, its answers.

Bytes of commands and answers are written as in `lamp on\r`, or as `hex A0 01 01 A2`.
"""

import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

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


Framing = Literal["8N1", "8E1", "8O1", "8N2", "7E1", "7O1"]


def _text(value: Any) -> Any:
    if isinstance(value, str):
        return value
    raise ValueError("expected text; put it in quotes, such as '1'")


def _bytes(text: str) -> str:
    wire_text(text)
    return text


def _some_bytes(text: str) -> str:
    if not wire_text(text).content:
        raise ValueError("expected at least one character")
    return text


_IsText = BeforeValidator(_text, json_schema_input_type=str)
#: Text that stands for some bytes, see `wire_text`; a `LineEnd` may be empty.
Bytes = Annotated[str, _IsText, AfterValidator(_some_bytes)]
LineEnd = Annotated[str, _IsText, AfterValidator(_bytes)]


class Exchange(FrozenModel):
    """A command, and what the board answers to it.

    Attributes
    ----------
    send
        Command, as text or as `hex A0 01`.
    answer
        Answer that confirms the command. Default: the board is not expected to answer.
    """

    send: Bytes
    answer: Bytes | None = None


def _exchange(value: Any) -> Any:
    if isinstance(value, str):
        return {"send": value}
    if isinstance(value, (dict, Exchange)):
        return value
    raise ValueError(
        "expected a command in quotes, such as 'lamp on', or {send: 'lamp on', answer: 'ok'}"
    )


Command = Annotated[Exchange, BeforeValidator(_exchange, json_schema_input_type=str | Exchange)]


class StateQuery(FrozenModel):
    """A query for the state of a relay, and the two answers to it.

    Attributes
    ----------
    send
        Query, as text or as `hex FF`.
    on, off
        Answer of the board if the relay is on, and if it is off.
    """

    send: Bytes
    on: Bytes
    off: Bytes

    @model_validator(mode="after")
    def _distinct(self) -> Self:
        on, off = wire_text(self.on), wire_text(self.off)
        if on.is_hex != off.is_hex or (on.is_hex and len(on.content) != len(off.content)):
            raise ValueError(
                "expected 'on' and 'off' both as text, or as equally many bytes in hexadecimal, "
                f"got '{self.on}' and '{self.off}'"
            )
        if on.content.split() == off.content.split():
            raise ValueError(f"expected different answers 'on' and 'off', got '{self.on}' for both")
        return self


class SwitchCommands(FrozenModel):
    r"""Commands of one relay.

    Attributes
    ----------
    on, off
        Command that switches the relay on, and off: `lamp on`, or with the answer that confirms it
        `{send: lamp on, answer: ok}`. Bytes beyond plain text are written as in `\r` and `\xA0`,
        or all in hexadecimal: `hex A0 01 01 A2`.
    state
        Query for the state of the relay, for example `{send: lamp?, on: on, off: off}`. Default:
        the state cannot be read back.
    """

    on: Command
    off: Command
    state: StateQuery | None = None

    @model_validator(mode="after")
    def _no_toggle(self) -> Self:
        if wire_text(self.on.send) == wire_text(self.off.send):
            raise ValueError(
                f"expected different commands 'on' and 'off', got '{self.on.send}' for both; a "
                "relay that a command toggles cannot be made safe"
            )
        return self


class BoardSettings(FrozenModel):
    """The serial line to a board, and commands that concern all of it.

    Attributes
    ----------
    baud
        Baud rate of the line; boards with a USB port of their own ignore it.
    framing
        Data bits, parity (none, even, odd) and stop bits of the line.
    line_end
        End of every command that is written as text; empty for none. A command in hexadecimal is
        sent as it stands.
    answer_end
        End of every answer that is written as text: the board's line end, or its prompt. An answer
        in hexadecimal is as long as it is written.
    answers_within
        Time within which the board answers.
    starts_in
        Time from the opening of the port until the board receives, for example `2 s` for an Arduino
        that restarts then.
    identity
        Query for the name or version of the board; with an `answer`, another board is refused.
    keep_alive
        Command that restarts the board's watchdog, sent about twice a minute.
    """

    baud: Annotated[int, Field(gt=0)] = 9600
    framing: Framing = "8N1"
    line_end: LineEnd = r"\n"
    answer_end: Bytes = r"\n"
    answers_within: Annotated[DurationS, Field(gt=0, le=60)] = 1.0
    starts_in: Annotated[DurationS, Field(ge=0, le=60)] = 0.0
    identity: Command | None = None
    keep_alive: Command | None = None
