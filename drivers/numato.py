"""Numato relay boards: ASCII over USB CDC, every command echoed, ended by a `>` prompt.

Echo and prompt prove that the board understood; the relay is read back after every write.
Source: Numato's documentation of the 16-channel board and their public sample code.
"""

import re

from pydantic import BaseModel, ConfigDict, Field

from labrig.acquire.connections import Connections
from labrig.errors import DeviceError, DeviceLostError

from .serial_line import SerialLine

#: USB CDC ignores it; Numato's own samples use this one.
BAUDRATE = 19200
ANSWER_TIMEOUT_S = 1.0
#: Longer than any pause inside an answer.
QUIET_S = 0.03
#: Before it is given up that a lamp could be switched off.
SAFE_TRIES = 5
RETRY_S = 1.0
_CHANNELS = "0123456789ABCDEFGHIJKLMNOPQRSTUV"


class NumatoRelay:
    """One relay of a Numato board, switching a lamp.

    Parameters
    ----------
    address
        Serial port of the board; several relays may share it.
    settings
        The rig file's keys for this device.
    connections
        Opens the port.
    """

    class Settings(BaseModel):
        """Keys of the rig file."""

        model_config = ConfigDict(frozen=True, extra="forbid")

        relay: int = Field(ge=0, lt=len(_CHANNELS))

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._address = address
        self._channel = _CHANNELS[settings.relay]
        self._relay = settings.relay
        port = connections.serial(address, BAUDRATE)
        self._name = f"the Numato board at {address}"
        self._clock = connections.clock
        self._line = SerialLine(port, self._clock, self._name)
        self._resynchronise()

    def identity(self) -> str:
        """Maker, firmware version and id, as the board says."""
        version, board_id = self._ask("ver"), self._ask("id get")
        return f"Numato relay board, firmware {version}, id {board_id}, relay {self._relay}"

    def on(self) -> None:
        """Switch on, read back."""
        self._switch("on")

    def off(self) -> None:
        """Switch off, read back."""
        self._switch("off")

    def is_on(self) -> bool:
        """State as the board reads it."""
        return self._read() == "on"

    def make_safe(self) -> None:
        """Bring the line back into step, then off; again if the board does not answer at once."""
        for tries_left in reversed(range(SAFE_TRIES)):
            try:
                self._resynchronise()
                self.off()
            except DeviceLostError:
                if not tries_left:
                    raise
                self._clock.sleep(RETRY_S)
            else:
                return

    def disconnect(self) -> None:
        """The port belongs to the connections, which close it."""

    def _switch(self, state: str) -> None:
        said = self._ask(f"relay {state} {self._channel}")
        if said:
            raise DeviceError(
                f"{self._name} refused 'relay {state} {self._channel}': expected a bare prompt, "
                f"got '{said}'; is relay {self._relay} on this board?"
            )
        read = self._read()
        if read != state:
            raise DeviceError(
                f"relay {self._relay} of {self._name} was switched {state} but reads {read}; "
                "switch off by hand and check the board"
            )

    def _read(self) -> str:
        state = self._ask(f"relay read {self._channel}")
        if state not in ("on", "off"):
            raise DeviceError(
                f"{self._name} was asked for relay {self._relay}: expected 'on' or 'off', "
                f"got '{state}'"
            )
        return state

    def _ask(self, command: str) -> str:
        self._line.write(command.encode("ascii") + b"\r")
        came = self._line.read_until(b">", ANSWER_TIMEOUT_S)
        lines = re.split(r"[\r\n]+", came.decode("ascii", errors="replace").removesuffix(">"))
        if lines[0] != command:
            raise DeviceLostError(
                f"{self._name} did not echo '{command}': got {came!r}; is it a Numato board, and "
                "its cable well?"
            )
        return " ".join(line for line in lines[1:] if line)

    def _resynchronise(self) -> None:
        """A bare return ends a half-typed command; whatever comes is of no interest."""
        self._line.write(b"\r")
        self._line.drain(QUIET_S, ANSWER_TIMEOUT_S)
