"""Conversion of a rig file's address to libgphoto2's name of a port."""

from urllib.parse import urlsplit

import usb.util

from labrig.acquire import Connections
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, UsageError

#: IANA's port for PTP/IP.
PTPIP_PORT = 15740


def port_path(address: str, connections: Connections) -> str:
    """Return libgphoto2's name of the port at `usb://vid:pid[/serial]` or `ptpip://host[:port]`.

    The address is held for this labrig; a camera on the network is dialled once and hung up, since
    libgphoto2 takes numbers only and is slow to report that no camera answers.

    Raises
    ------
    UsageError
        The address is of another kind, or the rig is simulated.
    DeviceError
        No camera is at the address.
    """
    scheme = urlsplit(address).scheme
    if scheme == "sim" or isinstance(connections.clock, VirtualClock):
        raise UsageError(
            f"{address}: gphoto2_camera works in real time, a simulated rig does not: use "
            "ptp_camera there, or 'labrig sim camera' and the address that it prints"
        )
    if scheme == "ptpip":
        return "ptpip:{0}:{1}:{1}".format(*_peer(address, connections))
    device = connections.usb(address)
    usb.util.dispose_resources(device)
    return f"usb:{device.bus:03d},{device.address:03d}"


def _peer(address: str, connections: Connections) -> tuple[str, int]:
    """Return the IP number and the port of a camera on the network."""
    try:
        with connections.tcp(address, PTPIP_PORT) as dialled:
            host, port = dialled.getpeername()[:2]
    except OSError as error:
        raise DeviceError(
            f"camera {address}: it hung up at once ({error}); switch it off and on"
        ) from None
    if ":" in host:
        raise UsageError(f"{address}: libgphoto2 needs an IPv4 address, this is {host}")
    return host, port
