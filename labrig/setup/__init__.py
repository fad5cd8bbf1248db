"""Setting up a bench: discovery of devices, check of a rig, live view."""

from labrig.setup.check import DeviceReport, RigReport, check_rig
from labrig.setup.discover import Discovery, FoundDevice, discover
from labrig.setup.host import Host
from labrig.setup.view import view_rig

__all__ = [
    "DeviceReport",
    "Discovery",
    "FoundDevice",
    "Host",
    "RigReport",
    "check_rig",
    "discover",
    "view_rig",
]
