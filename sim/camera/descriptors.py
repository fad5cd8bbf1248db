"""USB descriptors of a Canon EOS 5D Mark II in the shape that pyusb reads them."""

from types import SimpleNamespace

from . import usb_errors
from .still_image import BULK_IN, BULK_OUT, BULK_PACKET, INTERRUPT_IN, INTERRUPT_PACKET

VENDOR_ID, PRODUCT_ID = 0x04A9, 0x3199
CONFIGURATION_VALUE = 1
_ENGLISH = 0x0409
_STRING = 3
_STILL_IMAGE, _CAPTURE, _PTP = 6, 1, 1
_BULK, _INTERRUPT = 2, 3
_HIGH_SPEED = 3

#: By index; EOS cameras have no serial number here, only in PTP's DeviceInfo.
_STRINGS = {1: "Canon Inc.", 2: "Canon Digital Camera"}


def device(address: int) -> SimpleNamespace:
    """Device descriptor, and where the device is plugged in."""
    return SimpleNamespace(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200,
        bDeviceClass=0,
        bDeviceSubClass=0,
        bDeviceProtocol=0,
        bMaxPacketSize0=64,
        idVendor=VENDOR_ID,
        idProduct=PRODUCT_ID,
        bcdDevice=0x0002,
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=0,
        bNumConfigurations=1,
        address=address,
        bus=1,
        port_number=1,
        port_numbers=(1,),
        speed=_HIGH_SPEED,
    )


def configuration() -> SimpleNamespace:
    """The one configuration."""
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
    """The one interface: still image capture."""
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
    """The three endpoints, in their order."""
    return (
        _endpoint(BULK_IN, _BULK, BULK_PACKET, 0),
        _endpoint(BULK_OUT, _BULK, BULK_PACKET, 0),
        _endpoint(INTERRUPT_IN, _INTERRUPT, INTERRUPT_PACKET, 9),
    )


def string(index: int) -> bytes:
    """String descriptor of that index; the list of languages is number 0.

    Raises
    ------
    usb.core.USBError
        The camera has no such string and stalls the request.
    """
    if index == 0:
        body = _ENGLISH.to_bytes(2, "little")
    elif index in _STRINGS:
        body = _STRINGS[index].encode("utf-16-le")
    else:
        raise usb_errors.stalled()
    return bytes((2 + len(body), _STRING)) + body
