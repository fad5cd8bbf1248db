"""pyserial's URL handler for `sim://room/device`; pyserial finds it by this module's name.

The registry of open rooms is the one module-level state in labrig: pyserial passes nothing but the
URL to a handler.
"""

import errno
import os
from bisect import bisect_right
from typing import Protocol
from urllib.parse import urlsplit

import serial

from labrig.foundation.clock import VirtualClock

from .boards import SerialCable

#: A byte on a USB CDC line; a board's thinking time before it answers.
BYTE_S = 20e-6
ANSWER_S = 1.5e-3


class SerialRoom(Protocol):
    """A room with boards on serial lines."""

    @property
    def clock(self) -> VirtualClock:
        """Clock of the room."""

    @property
    def boards(self) -> dict[str, SerialCable]:
        """Boards on their cables, by the device part of their address."""


_ROOMS: dict[str, SerialRoom] = {}


def open_door(name: str, room: SerialRoom) -> None:
    """Make a room's boards reachable as `sim://name/board`."""
    _ROOMS[name] = room
    serial.protocol_handler_packages.insert(0, __package__)


def close_door(name: str) -> None:
    """Remove a room from the registry."""
    del _ROOMS[name]
    serial.protocol_handler_packages.remove(__package__)


class Serial(serial.SerialBase):
    """A serial port to an emulated board; once unplugged, it fails as a Linux port does."""

    def open(self) -> None:
        """Connect to the board that the URL names."""
        url = urlsplit(self.portstr or "")
        room = _ROOMS.get(url.netloc)
        cable = None if room is None else room.boards.get(url.path.strip("/"))
        if room is None or cable is None:
            raise serial.SerialException(f"there is no board at {self.portstr}")
        if not cable.is_plugged:
            missing = OSError(errno.ENOENT, os.strerror(errno.ENOENT), self.portstr)
            raise serial.SerialException(
                errno.ENOENT, f"could not open port {self.portstr}: {missing}"
            )
        self._clock = room.clock
        self._cable = cable
        self._plugging = cable.plugging
        self._incoming = b""
        self._due_s: list[float] = []
        self.is_open = True

    def close(self) -> None:
        """Disconnect."""
        self.is_open = False

    def _reconfigure_port(self) -> None:
        """Do nothing: line settings have no meaning for a USB CDC board."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes that have arrived by now."""
        if self._is_gone:
            raise _input_output_error()
        return bisect_right(self._due_s, self._clock.now())

    def read(self, size: int = 1, /) -> bytes:
        """Return up to `size` bytes that have arrived."""
        if self._is_gone:
            raise serial.SerialException(f"read failed: {_input_output_error()}")
        count = min(size, bisect_right(self._due_s, self._clock.now()))
        received = self._take(count)
        self._clock.spend(BYTE_S * count)
        return received

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        """Send `data`; the answer arrives byte by byte, a little later."""
        self._clock.spend(BYTE_S * len(data))
        if self._is_gone:
            raise serial.SerialException(f"write failed: {_input_output_error()}")
        last_s = self._due_s[-1] if self._due_s else 0.0
        due_s = max(last_s, self._clock.now() + ANSWER_S)
        answer = self._cable.carry(bytes(data))
        self._incoming += answer
        for _ in answer:
            due_s += BYTE_S
            self._due_s.append(due_s)
        return len(data)

    def reset_input_buffer(self) -> None:
        """Discard the bytes that have arrived."""
        self._take(self.in_waiting)

    def _take(self, count: int) -> bytes:
        received, self._incoming = self._incoming[:count], self._incoming[count:]
        del self._due_s[:count]
        return received

    @property
    def _is_gone(self) -> bool:
        return not self._cable.has_held(self._plugging)


def _input_output_error() -> OSError:
    return OSError(errno.EIO, os.strerror(errno.EIO))
