"""Finding and claiming the still image interface of a USB device."""

from dataclasses import dataclass
from typing import Any

import usb.core
import usb.util

from labrig.errors import DeviceError

STILL_IMAGE_CLASS = 6
_DIRECTION, _IN, _OUT = 0x80, 0x80, 0x00
_TRANSFER_TYPE, _BULK = 0x03, 0x02


@dataclass(frozen=True)
class StillImageInterface:
    """Numbers of the interface and its bulk endpoints, and the size of their packets in bytes."""

    interface: int
    bulk_in: int
    bulk_out: int
    packet_bytes: int


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
    bulk_in, bulk_out = (_bulk_endpoint(interface, direction) for direction in (_IN, _OUT))
    if bulk_in is None or bulk_out is None:
        raise DeviceError(
            f"camera {address}: expected two bulk endpoints on its PTP interface, found fewer: "
            "unplug it and plug it in again"
        )
    usb.util.claim_interface(device, interface)
    return StillImageInterface(
        interface=int(interface.bInterfaceNumber),
        bulk_in=int(bulk_in.bEndpointAddress),
        bulk_out=int(bulk_out.bEndpointAddress),
        packet_bytes=int(bulk_in.wMaxPacketSize),
    )


def _configuration(device: Any) -> Any:
    try:
        return device.get_active_configuration()
    except usb.core.USBError as failure:
        if failure.errno is not None:
            raise
        device.set_configuration()  # no error number is pyusb's way of saying that none is set
        return device.get_active_configuration()


def _bulk_endpoint(interface: Any, direction: int) -> Any:
    def matches(endpoint: Any) -> bool:
        address, attributes = int(endpoint.bEndpointAddress), int(endpoint.bmAttributes)
        return address & _DIRECTION == direction and attributes & _TRANSFER_TYPE == _BULK

    return usb.util.find_descriptor(interface, custom_match=matches)
