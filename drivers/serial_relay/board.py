"""The line to a board whose commands are in the rig file, and one relay of it."""

from collections.abc import Iterable, Sequence
from contextlib import suppress

from labrig.acquire import Connections, Finding
from labrig.foundation.errors import DeviceError, UnclearAnswerError

from ..serial_line import SerialLine
from .settings import BoardSettings, Exchange, SwitchCommands
from .wire_text import WireText, wire_text

#: Pause that ends an answer whose length is not known.
QUIET_S = 0.05
#: Bits of a byte on the line, with start, parity and stop bits.
BITS_OF_A_BYTE = 11


class Board:
    """A board; its devices may share the port.

    Parameters
    ----------
    address
        Serial port of the board.
    settings
        Line of the board, and the commands that concern all of it.
    connections
        Connections that open the port.

    Raises
    ------
    UnclearAnswerError
        The board does not identify itself as the rig file says.
    """

    def __init__(self, address: str, settings: BoardSettings, connections: Connections) -> None:
        self.name = f"the board at {address}"
        self._settings = settings
        self._clock = connections.clock
        self._line_end = wire_text(settings.line_end).content
        self._answer_end = wire_text(settings.answer_end).content
        port = connections.serial(address, settings.baud, settings.framing)
        self._line = SerialLine(port, self._clock, self.name)
        self._clock.sleep(settings.starts_in)
        if settings.identity is not None:
            self.resynchronise([settings.identity])
            self.identity()

    def identity(self) -> str:
        """Return the board's answer to its identity query, or its address if it has none."""
        query = self._settings.identity
        if query is None:
            return self.name.removeprefix("the ")
        if query.answer is not None:
            self.do(query)
            return query.answer
        return self._any_answer(wire_text(query.send))

    def keep_alive(self) -> None:
        """Restart the board's watchdog, if the rig file says how."""
        if self._settings.keep_alive is not None:
            self.do(self._settings.keep_alive)

    def do(self, exchange: Exchange) -> None:
        """Send a command; return when it is confirmed, or has left if it is never confirmed.

        Raises
        ------
        UnclearAnswerError
            The board gives another answer, or none.
        """
        sent = self._send(wire_text(exchange.send))
        if exchange.answer is None:
            self._clock.sleep(sent * BITS_OF_A_BYTE / self._settings.baud)
        else:
            self.expect(exchange.send, [exchange.answer])

    def ask(self, query: str, answers: Sequence[str]) -> str:
        """Send a query and return which of the possible answers came.

        Raises
        ------
        UnclearAnswerError
            The board gives another answer, or none.
        """
        self._send(wire_text(query))
        return self.expect(query, answers)

    def expect(self, sent: str, answers: Sequence[str]) -> str:
        """Read the answer to a command; return which of the possible ones it is."""
        expected = {text: self._as_read(wire_text(text)) for text in answers}
        received = self._read(wire_text(answers[0]))
        for text, content in expected.items():
            if received == content:
                return text
        with suppress(DeviceError):  # so that the next command is understood
            self._line.drain()
        raise UnclearAnswerError(
            f"{self.name} was sent '{sent}': expected {' or '.join(map(repr, answers))}, got "
            f"{received!r}; check its commands and answers in the rig file"
        )

    def resynchronise(self, harmless: Iterable[Exchange]) -> None:
        """Send commands that can do no harm without reading their answers, and discard all answers.

        A command that was cut off before ends with the first of these, which may be lost with it.
        """
        for exchange in harmless:
            text = wire_text(exchange.send)
            if self._line_end and not text.is_hex:
                self._line.write(self._line_end)
            self._send(text)
        self._line.drain()

    def _send(self, text: WireText) -> int:
        """Send a command and return the number of its bytes."""
        content = text.content if text.is_hex else text.content + self._line_end
        self._line.discard()
        self._line.write(content)
        return len(content)

    def _read(self, like: WireText) -> bytes:
        """Return the next answer, of as many bytes or lines as the expected one."""
        within_s = self._settings.answers_within
        if like.is_hex:
            return self._line.read_exactly(len(like.content), within_s)
        lines = like.content.removesuffix(self._answer_end).count(self._answer_end) + 1
        received = b"".join(self._line.read_until(self._answer_end, within_s) for _ in range(lines))
        return self._as_read(WireText(received, is_hex=False))

    def _as_read(self, text: WireText) -> bytes:
        """Return an answer as it is compared: bytes as they are, text without its white space."""
        if text.is_hex:
            return text.content
        return b" ".join(text.content.removesuffix(self._answer_end).split())

    def _any_answer(self, query: WireText) -> str:
        self._send(query)
        if query.is_hex:
            answer = self._line.read_burst(QUIET_S).hex(" ").upper()
        else:
            received = self._line.read_until(self._answer_end, self._settings.answers_within)
            answer = received.removesuffix(self._answer_end).decode("ascii", "backslashreplace")
        if not answer:
            raise UnclearAnswerError(
                f"{self.name} does not answer its query 'identity'; check its power, cable and "
                "address"
            )
        return " ".join(answer.split())


class Relay:
    """One relay of a board.

    Parameters
    ----------
    board
        Board that has the relay.
    commands
        Commands of the relay.
    name
        Name of what the relay switches in messages, such as `the lamp`.
    """

    def __init__(self, board: Board, commands: SwitchCommands, name: str) -> None:
        self._board = board
        self._commands = commands
        self._name = name
        #: State confirmed last, as far as the board confirms; None if it is unknown.
        self._last_on: bool | None = None

    @property
    def off(self) -> Exchange:
        """Command that switches the relay off."""
        return self._commands.off

    @property
    def reads_back(self) -> bool:
        """Whether the board reports the state of the relay."""
        return self._commands.state is not None

    @property
    def is_confirmed(self) -> bool:
        """Whether the board answers the commands of the relay."""
        return None not in (self._commands.on.answer, self._commands.off.answer)

    def switch(self, *, on: bool) -> None:
        """Switch the relay, and read it back where the board can.

        Raises
        ------
        UnclearAnswerError
            The board refuses, or the relay does not read as it was switched.
        """
        self._last_on = None
        self._board.do(self._commands.on if on else self._commands.off)
        self._last_on = on
        if self.reads_back and self.is_on() != on:
            state, opposite = ("on", "off") if on else ("off", "on")
            raise UnclearAnswerError(
                f"{self._name} of {self._board.name} was switched {state} but reads {opposite}; "
                "switch off by hand and check the board"
            )

    def is_on(self) -> bool:
        """Return the state that the board reports, else the one commanded last.

        After a command that failed the relay may be on, and counts as on.
        """
        query = self._commands.state
        if query is None:
            return self._last_on is not False
        return self._board.ask(query.send, [query.on, query.off]) == query.on


def findings(relays: Iterable[Relay]) -> list[Finding]:
    """Return whether anything but the camera can verify that the lights were switched."""
    relays = list(relays)
    if all(relay.reads_back for relay in relays):
        return [Finding("fine", "the board reports its states: they are read back")]
    what = (
        "this board confirms commands and does not report its state"
        if all(relay.is_confirmed for relay in relays)
        else "this board never acknowledges"
    )
    return [
        Finding(
            "warn",
            f"{what}: a relay that does not switch goes unnoticed here",
            "see the light flash now; in a run only the camera can tell. If the board has a query "
            "for its state, give it as 'state' in the rig file",
        )
    ]
