"""Opening of the camera at a rig file's address."""

from typing import Any

from labrig.acquire import Connections
from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from .codes import Standard
from .device_info import DeviceInfo, parse_device_info
from .session import Session
from .usb.link import UsbLink


def open_link(address: str, connections: Connections) -> UsbLink:
    """Return the link to the camera at an address of a USB device.

    Raises
    ------
    DeviceError
        No camera is at the address, or another program holds it.
    """
    clock = connections.clock
    device = connections.usb(address, lambda twin: _serial_number(twin, address, clock))
    return UsbLink(device, address, clock)


def open_session(session: Session) -> bool:
    """Open a session, through a reset if need be; return whether a dead program left one behind.

    Raises
    ------
    DeviceError
        The camera does not open a session.
    """
    try:
        return session.open()
    except DeviceError:
        session.start_over()
        return True


def identify(session: Session) -> DeviceInfo:
    """Return the camera's DeviceInfo.

    Raises
    ------
    DeviceError
        The camera does not answer, or violates the protocol.
    """
    return parse_device_info(session.transact(Standard.GetDeviceInfo).data)


def _serial_number(device: Any, address: str, clock: Clock) -> str:
    """Return the serial number from PTP of a camera that has it nowhere else, such as a Canon."""
    link = UsbLink(device, address, clock)
    try:
        session = Session(link, clock)
        was_left_open = open_session(session)
        serial = identify(session).serial
        # whoever takes the camera over must find that somebody left it as it is
        if not was_left_open:
            session.close()
        return serial
    finally:
        link.close()
