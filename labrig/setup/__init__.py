"""Setting up a bench: discovery of devices, check of a rig, live view."""

from labrig.setup.check import DeviceReport, RigReport, check_rig
from labrig.setup.discover import Discovery, FoundDevice, discover
from labrig.setup.host import Host
from labrig.setup.new_rig import Candidate, NewRig, candidates, simulated_candidates
from labrig.setup.rig_dialogue import Dialogue, Unattended, choose_devices, measure, set_up
from labrig.setup.view import view_rig

__all__ = [
    "Candidate",
    "DeviceReport",
    "Dialogue",
    "Discovery",
    "FoundDevice",
    "Host",
    "NewRig",
    "RigReport",
    "Unattended",
    "candidates",
    "check_rig",
    "choose_devices",
    "discover",
    "measure",
    "set_up",
    "simulated_candidates",
    "view_rig",
]
