"""Recognition of a serial board that comes back under another name.

A USB board that loses its power for a moment, or resets itself when its own relay disturbs it,
comes back as `/dev/ttyACM1` or COM4 while the rig file names `/dev/ttyACM0` or COM3. Its identity
on the USB stays the same.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self

from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from labrig.foundation.errors import DeviceError


@dataclass(frozen=True)
class UsbIdentity:
    """Identity of a serial board on the USB.

    Attributes
    ----------
    vendor, product
        Vendor and product number.
    serial_number
        Serial number; empty if the board reports none.
    interface
        Interface of the board, where it has several ports.
    place
        Plug on this PC, the only distinction of boards of one kind without serial numbers.
    """

    vendor: int
    product: int
    serial_number: str
    interface: str
    place: str

    @classmethod
    def of(cls, port: ListPortInfo) -> Self | None:
        """Return the identity of a port, None if it is not on the USB."""
        if port.vid is None or port.pid is None:
            return None
        place, _, interface = (port.location or "").partition(":")
        return cls(port.vid, port.pid, port.serial_number or "", interface, place)

    def is_like(self, other: "UsbIdentity") -> bool:
        """Return whether both may be the same board, possibly at another plug."""
        return (self.vendor, self.product, self.serial_number, self.interface) == (
            other.vendor, other.product, other.serial_number, other.interface
        )  # fmt: skip


@dataclass
class SerialPorts:
    """Serial boards of a rig, recognised by their identity at the first look-up."""

    _identities: dict[str, UsbIdentity] = field(default_factory=dict)

    def look_up(self, address: str) -> str:
        """Return the current port of the board that was at `address` at the first look-up.

        Raises
        ------
        DeviceError
            The board is missing, and another one is at `address`.
        """
        if "://" in address:
            return address
        present = dict(_usb_ports())
        current = _same_port(address, present)
        if address not in self._identities:
            if current is not None:
                self._identities[address] = present[current]
            return address
        expected = self._identities[address]
        matching = [port for port, identity in present.items() if identity.is_like(expected)]
        at_same_plug = [port for port in matching if present[port].place == expected.place]
        if current in (at_same_plug or matching):
            return address
        # Several of a kind, none where the board was: nobody can tell which of them it is.
        if len(candidates := at_same_plug or matching) == 1:
            return candidates[0]
        if current is not None:
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
    """Return the port that `address` names, possibly through a link or in lower case."""
    named = os.path.normcase(os.path.realpath(address))
    return next((p for p in ports if os.path.normcase(os.path.realpath(p)) == named), None)
