"""Finds a serial board again that comes back under another name.

A USB board that loses its power for a moment, or resets itself when its own relay disturbs it,
comes back as `/dev/ttyACM1` or COM4 while the rig file says `/dev/ttyACM0` or COM3. What it is on
the USB stays the same.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self

from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from labrig.errors import DeviceError


@dataclass(frozen=True)
class UsbIdentity:
    """What a serial board is on the USB.

    Attributes
    ----------
    interface
        Which of the board's ports, where it has several.
    place
        The plug on this PC; all that tells apart boards of one kind without serial numbers.
    """

    vendor: int
    product: int
    serial_number: str
    interface: str
    place: str

    @classmethod
    def of(cls, port: ListPortInfo) -> Self | None:
        """None for a port that is not on the USB."""
        if port.vid is None or port.pid is None:
            return None
        place, _, interface = (port.location or "").partition(":")
        return cls(port.vid, port.pid, port.serial_number or "", interface, place)

    def is_like(self, other: "UsbIdentity") -> bool:
        """Whether both may be the same board, in another place or not."""
        return (self.vendor, self.product, self.serial_number, self.interface) == (
            other.vendor, other.product, other.serial_number, other.interface
        )  # fmt: skip


@dataclass
class SerialPorts:
    """The serial boards of a rig, recognised from when each was looked up first."""

    _known: dict[str, UsbIdentity] = field(default_factory=dict)

    def look_up(self, address: str) -> str:
        """Where the board is now that was at `address` when that was looked up first.

        Raises
        ------
        DeviceError
            It is nowhere, and another board is at `address`.
        """
        if "://" in address:
            return address
        present = dict(_usb_ports())
        here = _same_port(address, present)
        if address not in self._known:
            if here is not None:
                self._known[address] = present[here]
            return address
        wanted = self._known[address]
        alike = [port for port, identity in present.items() if identity.is_like(wanted)]
        in_place = [port for port in alike if present[port].place == wanted.place]
        if here in (in_place or alike):
            return address
        # Several of a kind, none where the board was: nobody can tell which of them it is.
        if len(found := in_place or alike) == 1:
            return found[0]
        if here is not None:
            raise DeviceError(
                f"another board is at {address} now, and the one that was there before is gone; "
                "plug that in again"
            )
        return address


def _usb_ports() -> Iterable[tuple[str, UsbIdentity]]:
    for port in list_ports.comports():
        if identity := UsbIdentity.of(port):
            yield port.device, identity


def _same_port(address: str, ports: Iterable[str]) -> str | None:
    """The port that `address` names, perhaps through a link or in small letters."""
    named = os.path.normcase(os.path.realpath(address))
    return next((p for p in ports if os.path.normcase(os.path.realpath(p)) == named), None)
