"""USB descriptors of a still image camera in the shape that pyusb reads them."""

from dataclasses import dataclass
from types import SimpleNamespace

from ... import usb_errors
from ...usb_device import CONFIGURATION_VALUE
from .still_image import BULK_IN, BULK_OUT, BULK_PACKET, INTERRUPT_IN, INTERRUPT_PACKET

_ENGLISH = 0x0409
_STRING = 3
_STILL_IMAGE, _CAPTURE, _PTP = 6, 1, 1
_BULK, _INTERRUPT = 2, 3
_HIGH_SPEED = 3

_MANUFACTURER, _PRODUCT, _SERIAL = 1, 2, 3


@dataclass(frozen=True)
class UsbIdentity:
    """Identity of a device on the bus; one without a serial number has an empty one."""

    vendor_id: int
    product_id: int
    manufacturer: str
    product: str
    serial: str = ""


def device(address: int, identity: UsbIdentity) -> SimpleNamespace:
    """Return the device descriptor, with the device's place on the bus."""
    return SimpleNamespace(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200,
        bDeviceClass=0,
        bDeviceSubClass=0,
        bDeviceProtocol=0,
        bMaxPacketSize0=64,
        idVendor=identity.vendor_id,
        idProduct=identity.product_id,
        bcdDevice=0x0002,
        iManufacturer=_MANUFACTURER,
        iProduct=_PRODUCT,
        iSerialNumber=_SERIAL if identity.serial else 0,
        bNumConfigurations=1,
        address=address,
        bus=1,
        port_number=1,
        port_numbers=(1,),
        speed=_HIGH_SPEED,
    )


def configuration() -> SimpleNamespace:
    """Return the one configuration."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=2,
        wTotalLength=39,
        bNumInterfaces=1,
        bConfigurationValue=CONFIGURATION_VALUE,
        iConfiguration=0,
        bmAttributes=0xC0,
        bMaxPower=0,
        extra_descriptors=b"",
    )


def interface() -> SimpleNamespace:
    """Return the one interface: still image capture."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=4,
        bInterfaceNumber=0,
        bAlternateSetting=0,
        bNumEndpoints=3,
        bInterfaceClass=_STILL_IMAGE,
        bInterfaceSubClass=_CAPTURE,
        bInterfaceProtocol=_PTP,
        iInterface=0,
        extra_descriptors=b"",
    )


def _endpoint(address: int, attributes: int, packet: int, interval: int) -> SimpleNamespace:
    return SimpleNamespace(
        bLength=7,
        bDescriptorType=5,
        bEndpointAddress=address,
        bmAttributes=attributes,
        wMaxPacketSize=packet,
        bInterval=interval,
        bRefresh=0,
        bSynchAddress=0,
        extra_descriptors=b"",
    )


def endpoints() -> tuple[SimpleNamespace, ...]:
    """Return the three endpoints, in their order."""
    return (
        _endpoint(BULK_IN, _BULK, BULK_PACKET, 0),
        _endpoint(BULK_OUT, _BULK, BULK_PACKET, 0),
        _endpoint(INTERRUPT_IN, _INTERRUPT, INTERRUPT_PACKET, 9),
    )


def string(index: int, identity: UsbIdentity) -> bytes:
    """Return the string descriptor of that index; the list of languages is number 0.

    Raises
    ------
    usb.core.USBError
        The camera has no such string and stalls the request.
    """
    strings = {
        _MANUFACTURER: identity.manufacturer,
        _PRODUCT: identity.product,
        _SERIAL: identity.serial,
    }
    if index == 0:
        body = _ENGLISH.to_bytes(2, "little")
    elif strings.get(index):
        body = strings[index].encode("utf-16-le")
    else:
        raise usb_errors.stalled()
    return bytes((2 + len(body), _STRING)) + body
