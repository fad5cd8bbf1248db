"""What carries PTP containers between the PC and a camera, and which address is carried by what."""

from typing import Protocol
from urllib.parse import urlsplit

from labrig.acquire.connections import Connections

from .containers import Container
from .ip_link import PORT, IpLink
from .usb_link import UsbLink


class Link(Protocol):
    """Containers to and from one camera; every failure is a `DeviceError`."""

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send a command, and its data if it has some; `doing` says in messages what for."""

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """The next container with at most so much in it, within `timeout_s` a packet."""

    def cancel(self, transaction_id: int) -> None:
        """Have the camera give up a transaction and forget what it still sends."""

    def reset(self) -> None:
        """Put the camera's PTP side back to where it was before; its session is closed."""

    def close(self) -> None:
        """Let go of the camera; never raises."""


def open_link(address: str, connections: Connections) -> Link:
    """The link to the camera at `ptpip://host[:port]`, or at an address of a USB device.

    Raises
    ------
    DeviceError
        No camera there, or another program holds it.
    """
    if urlsplit(address).scheme == "ptpip":
        return IpLink(lambda: connections.tcp(address, PORT), address, connections.clock)
    return UsbLink(connections.usb(address), address, connections.clock)
