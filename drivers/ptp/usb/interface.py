"""Finding and claiming the still image interface of a USB device."""

from dataclasses import dataclass
from typing import Any

import usb.core
import usb.util

from labrig.errors import DeviceError

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
        It has none, or none with bulk endpoints.
    usb.core.USBError
        It cannot be claimed.
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
