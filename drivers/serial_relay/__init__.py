"""Any board on a serial line, by the commands in the rig file: relays, wheels, sample changers."""

from collections.abc import Hashable, Iterable, Sequence
from contextlib import suppress
from typing import Annotated

from pydantic import Field

from labrig.acquire import Board, Connections, Positions, Switch
from labrig.foundation.errors import DeviceError, UnclearAnswerError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from ..serial_line import SerialLine
from .settings import BoardSettings, Command, Exchange, SwitchCommands, WireText, wire_text

#: Pause that ends an answer whose length is not known.
QUIET_S = 0.05
#: Bits of a byte on the line, with start, parity and stop bits.
BITS_OF_A_BYTE = 11


class CommandedRelay(Switch):
    """One relay, read back after each switching if the rig file says how."""

    class Settings(SwitchCommands):
        """Keys of a relay."""

    noun = "command 'on'"
    board: "SerialRelay"
    settings: Settings

    def __init__(self, board: "SerialRelay", settings: Settings) -> None:
        super().__init__(board, settings)
        board.harmless.append(settings.off)

    @classmethod
    def distinct(cls, settings: SwitchCommands) -> Hashable:
        """Return the bytes of the command that switches on."""
        return wire_text(settings.on.send)

    @property
    def name(self) -> str:
        """Name of the relay in messages, by its command."""
        return f"the relay of '{self.settings.on.send}' of {self.board.name}"

    def place(self) -> str:
        """Return nothing: a relay has no number."""
        return ""

    def reads_back(self) -> bool:
        """Return whether the rig file has a query for the state of the relay."""
        return self.settings.state is not None

    def acknowledges(self) -> bool:
        """Return whether the rig file has answers to the commands of the relay."""
        return None not in (self.settings.on.answer, self.settings.off.answer)

    def command(self, *, on: bool) -> None:
        """Send a command; return when it is confirmed, or has left if it is never confirmed."""
        self.board.do(self.settings.on if on else self.settings.off)

    def is_on(self) -> bool:
        """Return the state that the board reports, else the one commanded last."""
        query = self.settings.state
        if query is None:
            return super().is_on()
        return self.board.ask(query.send, [query.on, query.off]) == query.on


class CommandedPositions(Positions):
    """Things that a board brings into place, by one command for each position."""

    class Settings(FrozenModel):
        """Keys of a part that moves.

        Attributes
        ----------
        travel
            Time of a move, for example `3 s`. It is waited for where a command has no answer.
        """

        travel: Annotated[DurationS, Field(ge=0, le=60)] = 3.0

    Position = Command
    noun = "command"
    board: "SerialRelay"
    settings: Settings

    @classmethod
    def distinct(cls, position: Exchange) -> Hashable:
        """Return the command."""
        return position.send

    def place(self) -> str:
        """Return nothing: a part that moves has no number."""
        return ""

    def bring(self, position: Exchange) -> None:
        """Return when the board confirms it, or when the time of a move is over."""
        self.board.do(position)
        if position.answer is None:
            self.board.clock.sleep(self.settings.travel)

    def make_safe(self, position: Exchange) -> None:
        """Resynchronise the line, then move to the safe position."""
        self.board.send_unread([position])
        self.bring(position)


class SerialRelay(Board):
    """A board whose commands are in the rig file; its devices may share the port.

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

    has_own_commands = True

    class Settings(BoardSettings):
        """Keys of the line, and commands that concern all of the board."""

    channels = (CommandedRelay, CommandedPositions)

    def __init__(self, address: str, settings: BoardSettings, connections: Connections) -> None:
        self.name = f"the board at {address}"
        self._settings = settings
        self.clock = connections.clock
        self._line_end = wire_text(settings.line_end).content
        self._answer_end = wire_text(settings.answer_end).content
        port = connections.serial(address, settings.baud, settings.framing)
        self._line = SerialLine(port, self.clock, self.name)
        self.clock.sleep(settings.starts_in)
        #: Commands that can do no harm, such as those that switch the channels off.
        self.harmless: list[Exchange] = []
        if settings.identity is not None:
            self.send_unread([settings.identity])
            self.identity()

    def identity(self) -> str:
        """Return the board's answer to its identity query, or its address if it has none."""
        query = self._settings.identity
        if query is None:
            answer = self.name.removeprefix("the ")
        elif query.answer is None:
            answer = self._any_answer(wire_text(query.send))
        else:
            self.do(query)
            answer = query.answer
        return f"serial relay, {answer}"

    def heartbeat(self) -> None:
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
            self.clock.sleep(sent * BITS_OF_A_BYTE / self._settings.baud)
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

    def resynchronise(self) -> None:
        """Send what can do no harm without reading the answers, and discard all answers."""
        self.send_unread(self.harmless)

    def send_unread(self, harmless: Iterable[Exchange]) -> None:
        """Send commands without reading their answers, and discard all answers.

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
