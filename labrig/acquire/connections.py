"""Connections from drivers to devices: one resolver from address to transport."""

import socket
from collections.abc import Callable
from typing import Any, Protocol

from labrig.foundation.clock import Clock


class SerialPort(Protocol):
    """The part of pyserial's `Serial` that drivers use; reads never block."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes that can be read at once."""

    def read(self, size: int = 1, /) -> bytes:
        """Read up to `size` bytes that have been received."""

    def write(self, data: bytes, /) -> int | None:
        """Send all of `data`."""

    def close(self) -> None:
        """Close the port."""


class Connections(Protocol):
    """Factory of transports to real and simulated devices; each address has one user."""

    @property
    def clock(self) -> Clock:
        """Clock on which time-outs count."""

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        """Return the serial port at `COM3`, `/dev/…` or `sim://room/device`, shared by its users.

        Parameters
        ----------
        address
            Address in the rig file.
        baudrate
            Bits per second of the line.
        framing
            Data bits, parity (none, even, odd) and stop bits, such as `8N1`.

        Raises
        ------
        DeviceError
            If there is no such port, or another program holds it.
        UsageError
            If another device of the rig uses the port with other line settings.
        """

    def usb(self, address: str, serial_of: Callable[[Any], str] | None = None) -> Any:
        """Return the `usb.core.Device` at `usb://vid:pid[/serial]` or `sim://room/device`.

        Parameters
        ----------
        address
            Address in the rig file.
        serial_of
            Function that queries the serial number of a device without one in its USB descriptor,
            and releases the device again.

        Raises
        ------
        DeviceError
            If there is no such device, or access is refused.
        """

    def tcp(self, address: str, default_port: int) -> socket.socket:
        """Open another connection to the device at `scheme://host[:port]`.

        Raises
        ------
        DeviceError
            If there is no such host, or it refuses the connection.
        """
