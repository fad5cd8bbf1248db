"""A still image device through pyusb: bytes in and out, and what went wrong in one line.

pyusb carries no types, so `Any` ends here.
"""

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import usb.core
import usb.util

from ..failures import UnpluggedError
from .errors import WAKE_UP, usb_errors_explained
from .interface import claim_still_image

HOST_TO_INTERFACE, INTERFACE_TO_HOST = 0x21, 0xA1
MOST_CONTROL_BYTES = 32
CONTROL_TIMEOUT_S = 2.0
WRITE_TIMEOUT_S = 5.0


class UsbDevice:
    """Endpoints and class requests of the still image interface, which it claims.

    Every method raises `DeviceError` alone: `NoAnswerError`, `StallError`, `UnpluggedError` or
    plain. `doing` says in its message what for.

    Parameters
    ----------
    device
        The `usb.core.Device`.
    address
        What messages call it.
    """

    def __init__(self, device: Any, address: str) -> None:
        self._device = device
        self._address = address
        self._is_gone = False
        with self._named("opening its PTP interface"):
            self._endpoints = claim_still_image(device, address)

    @property
    def packet_bytes(self) -> int:
        """Size of a full packet on the bulk endpoints."""
        return self._endpoints.packet_bytes

    @property
    def has_events(self) -> bool:
        """Whether there is an endpoint on which it can report by itself."""
        return self._endpoints.interrupt_in is not None

    def write(self, data: bytes, doing: str) -> int:
        """Send one transfer; returns how many bytes it took."""
        with self._named(doing):
            return int(self._device.write(self._endpoints.bulk_out, data, _ms(WRITE_TIMEOUT_S)))

    def read(self, most_bytes: int, timeout_s: float, doing: str) -> bytes:
        """One transfer, of whole packets but the last."""
        with self._named(f"{doing} within {timeout_s:g} s"):
            return bytes(self._device.read(self._endpoints.bulk_in, most_bytes, _ms(timeout_s)))

    def read_event_packet(self, timeout_s: float, doing: str) -> bytes:
        """One packet of an event: a longer read would wait for more behind a full last one."""
        size = self._endpoints.event_packet_bytes
        with self._named(doing):
            return bytes(self._device.read(self._endpoints.interrupt_in, size, _ms(timeout_s)))

    def request(self, request: int, data: bytes, doing: str) -> None:
        """A class request with data."""
        with self._named(doing):
            self._device.ctrl_transfer(
                HOST_TO_INTERFACE,
                request,
                0,
                self._endpoints.interface,
                data,
                _ms(CONTROL_TIMEOUT_S),
            )

    def ask(self, request: int, doing: str) -> bytes:
        """A class request that has an answer."""
        with self._named(doing):
            return bytes(
                self._device.ctrl_transfer(
                    INTERFACE_TO_HOST,
                    request,
                    0,
                    self._endpoints.interface,
                    MOST_CONTROL_BYTES,
                    _ms(CONTROL_TIMEOUT_S),
                )
            )

    def clear_bulk_halts(self) -> None:
        """Let both bulk endpoints go on after a stall."""
        with self._named("clearing a halted endpoint"):
            for endpoint in (self._endpoints.bulk_in, self._endpoints.bulk_out):
                self._device.clear_halt(endpoint)

    def clear_event_halt(self) -> None:
        """Let the interrupt endpoint go on after a stall."""
        with self._named("clearing a halted endpoint"):
            self._device.clear_halt(self._endpoints.interrupt_in)

    def close(self) -> None:
        """Release the interface; says nothing if the device is gone already."""
        with suppress(usb.core.USBError, NotImplementedError):
            usb.util.dispose_resources(self._device)

    @contextmanager
    def _named(self, doing: str) -> Iterator[None]:
        """Name what pyusb could not do; a camera that is gone stays so."""
        context = f"camera {self._address}: {doing}"
        if self._is_gone:
            raise UnpluggedError(f"{context}: it is gone: {WAKE_UP}")
        with usb_errors_explained(context):
            try:
                yield
            except usb.core.USBError as failure:
                self._is_gone = failure.errno == errno.ENODEV
                raise


def _ms(duration_s: float) -> int:
    return max(1, round(duration_s * 1e3))
