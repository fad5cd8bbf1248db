"""A still image device through pyusb: bytes in and out, and errors in one line.

pyusb carries no types, so `Any` ends here.
"""

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import usb.core
import usb.util

from labrig.foundation.errors import DeviceError

from ..failures import NoAnswerError, StallError, UnpluggedError

WAKE_UP = "switch the camera on, its automatic switching-off to never, and check cable and battery"

_GONE = {errno.ENODEV, errno.EIO, errno.ENXIO, errno.ESHUTDOWN}


@contextmanager
def usb_errors_explained(context: str) -> Iterator[None]:
    """Turn pyusb's errors into `DeviceError`.

    Parameters
    ----------
    context
        Name of the device, and the purpose of the call.

    Raises
    ------
    DeviceError
        In place of any error of pyusb: `NoAnswerError`, `StallError`, `UnpluggedError` or plain.
    """
    try:
        yield
    except usb.core.USBError as failure:
        number = failure.errno
        if isinstance(failure, usb.core.USBTimeoutError) or number == errno.ETIMEDOUT:
            raise NoAnswerError(f"{context}: no answer: {WAKE_UP}") from failure
        if number == errno.EPIPE:
            raise StallError(f"{context}: it halted the transfer (stall): try again") from failure
        if number in _GONE:
            raise UnpluggedError(f"{context}: it is gone ({failure}): {WAKE_UP}") from failure
        raise DeviceError(f"{context}: {failure}: {_remedy(number)}") from failure
    except (usb.core.NoBackendError, NotImplementedError) as failure:
        raise DeviceError(
            f"{context}: this PC has no USB driver for it ({failure}): install libusb, "
            "on Windows give the camera the WinUSB driver with Zadig"
        ) from failure


def _remedy(number: int | None) -> str:
    if number == errno.EBUSY:
        return (
            "another program holds it: close the desktop's photo import (gvfs, PTPCamera), "
            "gphoto2 and EOS Utility"
        )
    if number == errno.EACCES:
        return "you may not use it: add a udev rule for the camera, or log in at the PC itself"
    return "unplug it and plug it in again"


STILL_IMAGE_CLASS = 6
_DIRECTION, _IN, _OUT = 0x80, 0x80, 0x00
_TRANSFER_TYPE, _BULK, _INTERRUPT = 0x03, 0x02, 0x03


@dataclass(frozen=True)
class StillImageInterface:
    """Numbers of the interface and its endpoints, and the size of their packets in bytes.

    The interrupt endpoint is the camera's for events; one without an endpoint has number `None`.
    """

    interface: int
    bulk_in: int
    bulk_out: int
    packet_bytes: int
    interrupt_in: int | None
    event_packet_bytes: int


def claim_still_image(device: Any, address: str) -> StillImageInterface:
    """Claim the still image interface of a `usb.core.Device`.

    Raises
    ------
    DeviceError
        The device has no such interface, or none with bulk endpoints.
    usb.core.USBError
        The interface cannot be claimed.
    """
    configuration = _configuration(device)
    interface = usb.util.find_descriptor(configuration, bInterfaceClass=STILL_IMAGE_CLASS)
    if interface is None:
        raise DeviceError(
            f"camera {address}: expected a still image (PTP) interface, found none: "
            "set the camera's USB mode to PTP or 'PC connection'"
        )
    bulk_in, bulk_out = (_endpoint(interface, direction, _BULK) for direction in (_IN, _OUT))
    if bulk_in is None or bulk_out is None:
        raise DeviceError(
            f"camera {address}: expected two bulk endpoints on its PTP interface, found fewer: "
            "unplug it and plug it in again"
        )
    interrupt_in = _endpoint(interface, _IN, _INTERRUPT)
    usb.util.claim_interface(device, interface)
    return StillImageInterface(
        interface=int(interface.bInterfaceNumber),
        bulk_in=int(bulk_in.bEndpointAddress),
        bulk_out=int(bulk_out.bEndpointAddress),
        packet_bytes=int(bulk_in.wMaxPacketSize),
        interrupt_in=None if interrupt_in is None else int(interrupt_in.bEndpointAddress),
        event_packet_bytes=0 if interrupt_in is None else int(interrupt_in.wMaxPacketSize),
    )


def _configuration(device: Any) -> Any:
    try:
        return device.get_active_configuration()
    except usb.core.USBError as failure:
        if failure.errno is not None:
            raise
        device.set_configuration()  # no error number is pyusb's way of saying that none is set
        return device.get_active_configuration()


def _endpoint(interface: Any, direction: int, transfer_type: int) -> Any:
    def matches(endpoint: Any) -> bool:
        address, attributes = int(endpoint.bEndpointAddress), int(endpoint.bmAttributes)
        return address & _DIRECTION == direction and attributes & _TRANSFER_TYPE == transfer_type

    return usb.util.find_descriptor(interface, custom_match=matches)


HOST_TO_INTERFACE, INTERFACE_TO_HOST = 0x21, 0xA1
MAX_CONTROL_BYTES = 32
CONTROL_TIMEOUT_S = 2.0
WRITE_TIMEOUT_S = 5.0


class UsbDevice:
    """Endpoints and class requests of the still image interface, which it claims.

    Every method raises `DeviceError` alone: `NoAnswerError`, `StallError`, `UnpluggedError` or
    plain. `doing` is the purpose of the call in its message.

    Parameters
    ----------
    device
        The `usb.core.Device`.
    address
        Address of the device, for messages.
    """

    def __init__(self, device: Any, address: str) -> None:
        self._device = device
        self._address = address
        self._is_gone = False
        with self._naming_errors("opening its PTP interface"):
            self._endpoints = claim_still_image(device, address)

    @property
    def packet_bytes(self) -> int:
        """Size of a full packet on the bulk endpoints."""
        return self._endpoints.packet_bytes

    @property
    def has_events(self) -> bool:
        """Whether there is an endpoint for events."""
        return self._endpoints.interrupt_in is not None

    def write(self, data: bytes, doing: str) -> int:
        """Send one transfer; return the number of bytes that the device took."""
        with self._naming_errors(doing):
            return int(self._device.write(self._endpoints.bulk_out, data, _ms(WRITE_TIMEOUT_S)))

    def read(self, most_bytes: int, timeout_s: float, doing: str) -> bytes:
        """Return one transfer, of whole packets but the last."""
        with self._naming_errors(f"{doing} within {timeout_s:g} s"):
            return bytes(self._device.read(self._endpoints.bulk_in, most_bytes, _ms(timeout_s)))

    def read_event_packet(self, timeout_s: float, doing: str) -> bytes:
        """Return one packet of an event: a longer read would wait for more after a full one."""
        size = self._endpoints.event_packet_bytes
        with self._naming_errors(doing):
            return bytes(self._device.read(self._endpoints.interrupt_in, size, _ms(timeout_s)))

    def request(self, request: int, data: bytes, doing: str) -> None:
        """Send a class request with data."""
        with self._naming_errors(doing):
            self._device.ctrl_transfer(
                HOST_TO_INTERFACE,
                request,
                0,
                self._endpoints.interface,
                data,
                _ms(CONTROL_TIMEOUT_S),
            )

    def ask(self, request: int, doing: str) -> bytes:
        """Send a class request and return its answer."""
        with self._naming_errors(doing):
            return bytes(
                self._device.ctrl_transfer(
                    INTERFACE_TO_HOST,
                    request,
                    0,
                    self._endpoints.interface,
                    MAX_CONTROL_BYTES,
                    _ms(CONTROL_TIMEOUT_S),
                )
            )

    def clear_bulk_halts(self) -> None:
        """Let both bulk endpoints go on after a stall."""
        with self._naming_errors("clearing a halted endpoint"):
            for endpoint in (self._endpoints.bulk_in, self._endpoints.bulk_out):
                self._device.clear_halt(endpoint)

    def clear_event_halt(self) -> None:
        """Let the interrupt endpoint go on after a stall."""
        with self._naming_errors("clearing a halted endpoint"):
            self._device.clear_halt(self._endpoints.interrupt_in)

    def close(self) -> None:
        """Release the interface; does not raise if the device is gone already."""
        with suppress(usb.core.USBError, NotImplementedError):
            usb.util.dispose_resources(self._device)

    @contextmanager
    def _naming_errors(self, doing: str) -> Iterator[None]:
        """Name pyusb's failed call in its error; a camera that is gone stays so."""
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
