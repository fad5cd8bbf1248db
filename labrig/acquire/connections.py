"""How a driver reaches its device: one resolver from address to transport."""

import socket
from collections.abc import Callable
from typing import Any, Protocol

from labrig.clock import Clock


class SerialPort(Protocol):
    """The part of pyserial's `Serial` that drivers use; reads never block."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""

    def read(self, size: int = 1, /) -> bytes:
        """Up to `size` bytes that are there already."""

    def write(self, data: bytes, /) -> int | None:
        """Send all of `data`."""

    def close(self) -> None:
        """Release the port."""


class Connections(Protocol):
    """Opens transports for drivers, real or simulated alike; one user an address."""

    @property
    def clock(self) -> Clock:
        """The clock on which time-outs count."""

    def serial(self, address: str, baudrate: int) -> SerialPort:
        """The serial port at `COM3`, `/dev/…` or `sim://room/device`, shared by its users.

        Raises
        ------
        DeviceError
            There is no such port, or something else holds it.
        """

    def usb(self, address: str, serial_of: Callable[[Any], str] | None = None) -> Any:
        """The `usb.core.Device` at `usb://vid:pid[/serial]` or `sim://room/device`.

        Parameters
        ----------
        serial_of
            Asks a device for its serial number that tells none on the bus, and releases it again.

        Raises
        ------
        DeviceError
            No such device, or access is refused.
        """

    def tcp(self, address: str, default_port: int) -> socket.socket:
        """Another connection to the device at `scheme://host[:port]`, each time it is called.

        Raises
        ------
        DeviceError
            There is no such host, or nobody listens there.
        """
