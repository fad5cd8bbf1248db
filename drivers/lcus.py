"""LCUS relay boards (LC Technology, CH340): four bytes a command, and never an acknowledgement.

Boards with several relays answer the query FF, in text or in bytes, the first time often with the
previous states; LCUS-1 never answers. Sources: sellers' data sheets of LCUS-1 to LCUS-8 and the
public drivers of brzycki, AscomSwitchDriver and MultiRoomAudio.
"""

import re
from collections.abc import Sequence

from pydantic import Field

from labrig.acquire import Connections, Finding
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.models import FrozenModel

from .serial_line import LATEST_ANSWER_S, SerialLine

BAUDRATE = 9600
QUERY = b"\xff"
#: Pause that ends an answer of the board.
QUIET_S = 0.05
#: Time of a command at 9600 baud: ten bits a byte.
COMMAND_S = 4 * 10 / BAUDRATE
MAX_RELAYS = 8
_LINE = re.compile(rb"CH(\d+): *(ON|OFF) *\r\n")


class LcusRelay:
    """One relay of an LCUS board, switching a lamp.

    `on` and `off` return when the command has left the PC, without any sign that it was obeyed. A
    board that answers the query is queried by `is_on` and `make_safe`, not by `on` and `off`: two
    queries take a fifth of a second, in which a halogen lamp fades, and the time at which the lamp
    was switched would be as uncertain.

    Parameters
    ----------
    address
        Serial port of the board; several relays may share it.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(FrozenModel):
        """Keys of a relay of an LCUS board in a rig file.

        Attributes
        ----------
        relay
            Number of the relay that switches the lamp, as printed on the board: the first one is 1.
        """

        relay: int = Field(ge=1, le=MAX_RELAYS)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relay = settings.relay
        self._name = f"the LCUS board at {address}"
        self._clock = connections.clock
        self._line = SerialLine(connections.serial(address, BAUDRATE), self._clock, self._name)
        self._commanded_on = False
        self._send(on=False)
        self._answers = self._query() is not None

    def reads_back(self) -> bool:
        """Return whether the board answers its query."""
        return self._answers

    def identity(self) -> str:
        """Return the number of relays that the board reports, or that it never acknowledges."""
        states = self._query() if self._answers else None
        description = (
            "never acknowledges: only the camera can verify it"
            if states is None
            else f"{len(states)} relays, read back by query"
        )
        return f"LCUS relay board ({description}), relay {self._relay}"

    def findings(self) -> Sequence[Finding]:
        """Return whether anything but the camera can verify that the lamp was switched."""
        if self._answers:
            return [Finding("fine", "the board answers its query: its register is read back")]
        return [
            Finding(
                "warn",
                "this board never acknowledges: a relay that does not switch goes unnoticed here",
                "see the lamp flash three times now; in a run only the camera can tell, so keep "
                "photographs under the lamp and after it (protocol 'decay' takes them)",
            )
        ]

    def on(self) -> None:
        """Send the command to switch on; see the class about reading back."""
        self._send(on=True)

    def off(self) -> None:
        """Send the command to switch off; see the class about reading back."""
        self._send(on=False)

    def is_on(self) -> bool:
        """Return the board's register, where it answers its query; else the last command.

        A board that never acknowledges may have missed the command, or its contact may be welded.
        The register does not show the contact, either.
        """
        return self._read() if self._answers else self._commanded_on

    def make_safe(self) -> None:
        """Switch off twice, as the second command ends one that was cut off; read back if possible.

        Raises
        ------
        UnclearAnswerError
            The relay reads on, or the board has answered before and does not now.
        """
        self._send(on=False)
        self._send(on=False)
        if self._answers and self._read():
            raise UnclearAnswerError(
                f"relay {self._relay} of {self._name} was switched off but reads on; switch off by "
                "hand and check the board"
            )

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""

    def _send(self, *, on: bool) -> None:
        self._line.write(command(self._relay, on=on))
        self._commanded_on = on
        self._clock.sleep(COMMAND_S)

    def _read(self) -> bool:
        states = self._query()
        if states is None:
            raise UnclearAnswerError(
                f"{self._name} answered its query before and does not within {LATEST_ANSWER_S:g} s "
                "now; check its power and cable"
            )
        return states[self._relay - 1]

    def _query(self) -> tuple[bool, ...] | None:
        """Return the states of all relays; None without an answer. The first answer may be old."""
        self._line.drain()
        for _ in range(2):
            self._line.write(QUERY)
            answer = self._line.read_burst(QUIET_S)
        if not answer:
            return None
        states = relay_states(answer)
        if len(states) < self._relay:
            raise UnclearAnswerError(
                f"{self._name} was asked for relay {self._relay}: expected 'CH{self._relay}: ON' "
                f"or 'OFF', or a byte for each relay, got {answer!r}; is it an LCUS board, and has "
                "it that many relays?"
            )
        return states


def command(relay: int, *, on: bool) -> bytes:
    """Return the command's bytes: A0, relay, 1 or 0, and the sum of these three in a byte."""
    return bytes((0xA0, relay, on, (0xA0 + relay + on) & 0xFF))


def relay_states(answer: bytes) -> tuple[bool, ...]:
    """Return the states of relays 1, 2, … in an answer to the query; empty if it is none.

    Parameters
    ----------
    answer
        Lines such as `CH1: ON`, numbered without a gap, or one byte 00 or 01 for each relay.
    """
    if set(answer) <= {0, 1}:
        return tuple(byte == 1 for byte in answer)
    lines = _LINE.findall(answer)
    numbered = [int(number) for number, _ in lines] == list(range(1, len(lines) + 1))
    if not numbered or _LINE.sub(b"", answer):
        return ()
    return tuple(state == b"ON" for _, state in lines)
