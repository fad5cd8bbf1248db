"""LCUS relay boards (LC Technology, CH340): four bytes a command, and never an acknowledgement.

Boards with several relays answer the query FF, in text or in bytes, the first time often with the
previous states; LCUS-1 never answers. Sources: sellers' data sheets of LCUS-1 to LCUS-8 and the
public drivers of brzycki, AscomSwitchDriver and MultiRoomAudio.
"""

import re
from collections.abc import Sequence

from pydantic import Field

from labrig.acquire import Board, Connections, Switch
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


class LcusRelay(Switch):
    """One relay of an LCUS board.

    It is switched when the command has left the PC, without any sign that it was obeyed. A board
    that answers the query is queried by `is_on` and when it is made safe, not at each switching:
    two queries take a fifth of a second, in which a halogen lamp fades, and the time at which the
    light was switched would be as uncertain.
    """

    class Settings(FrozenModel):
        """Keys of a relay of an LCUS board.

        Attributes
        ----------
        relay
            Number of the relay, as printed on the board: the first one is 1.
        """

        relay: int = Field(ge=1, le=MAX_RELAYS)

    noun = "relay"
    board: "Lcus"
    settings: Settings

    def __init__(self, board: "Lcus", settings: Settings) -> None:
        super().__init__(board, settings)
        self.switch(on=False)
        if board.answers is None:
            board.answers = board.query(settings.relay) is not None

    def place(self) -> str:
        """Return the number of the relay."""
        return f"relay {self.settings.relay}"

    def reads_back(self) -> bool:
        """Return whether the board answers its query."""
        return bool(self.board.answers)

    def command(self, *, on: bool) -> None:
        """Send the command; return when it has left the PC."""
        self.board.send(command(self.settings.relay, on=on))

    def switch(self, *, on: bool) -> None:
        """Send the command; see the class about reading back."""
        self.state = None
        self.command(on=on)
        self.state = on

    def is_on(self) -> bool:
        """Return the board's register, where it answers its query; else the last command.

        A board that never acknowledges may have missed the command, or its contact may be welded.
        The register does not show the contact, either.
        """
        return self.board.are_on([self])[0]


class Lcus(Board):
    """An LCUS board.

    Parameters
    ----------
    address
        Serial port of the board.
    settings
        Keys of the rig file.
    connections
        Connections that open the port.

    Attributes
    ----------
    answers
        Whether the board answers its query; None until its first relay has been switched off.
    """

    channels = (LcusRelay,)

    def __init__(self, address: str, settings: Board.Settings, connections: Connections) -> None:
        self.name = f"the LCUS board at {address}"
        self._clock = connections.clock
        self._line = SerialLine(connections.serial(address, BAUDRATE), self._clock, self.name)
        self.answers: bool | None = None

    def identity(self) -> str:
        """Return the number of relays that the board reports, or that it never acknowledges."""
        states = self.query(1) if self.answers else None
        description = (
            "never acknowledges: only the camera can verify it"
            if states is None
            else f"{len(states)} relays, read back by query"
        )
        return f"LCUS relay board ({description})"

    def are_on(self, switches: Sequence[Switch]) -> list[bool]:
        """Return the states of some relays by one query, else those commanded last."""
        if not self.answers:
            return [switch.state is not False for switch in switches]
        relays = [switch.settings.relay for switch in switches]
        states = self.query(max(relays))
        if states is None:
            raise UnclearAnswerError(
                f"{self.name} answered its query before and does not within {LATEST_ANSWER_S:g} s "
                "now; check its power and cable"
            )
        return [states[relay - 1] for relay in relays]

    def make_safe(self, switches: Sequence[Switch]) -> None:
        """Switch off twice, as the second command ends one that was cut off; read back if possible.

        Raises
        ------
        UnclearAnswerError
            A relay reads on, or the board has answered before and does not now.
        """
        for switch in (*switches, *switches):
            switch.switch(on=False)
        for switch, is_on in zip(switches, self.are_on(switches), strict=True):
            if is_on:
                raise switch.contradicts(on=False)

    def send(self, data: bytes) -> None:
        """Send a command; return when it has left the PC."""
        self._line.write(data)
        self._clock.sleep(COMMAND_S)

    def query(self, relay: int) -> tuple[bool, ...] | None:
        """Return the states of all relays; None without an answer. The first answer may be old.

        Raises
        ------
        UnclearAnswerError
            The answer is another board's, or the board has no such relay.
        """
        self._line.drain()
        for _ in range(2):
            self._line.write(QUERY)
            answer = self._line.read_burst(QUIET_S)
        if not answer:
            return None
        states = relay_states(answer)
        if len(states) < relay:
            raise UnclearAnswerError(
                f"{self.name} was asked for relay {relay}: expected 'CH{relay}: ON' or 'OFF', or a "
                f"byte for each relay, got {answer!r}; is it an LCUS board, and has it that many "
                "relays?"
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
