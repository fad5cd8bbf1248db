"""Devices by role, the rig file, protocols as units, the plan and the runner."""

from labrig.acquire.actions import (
    DOOR_CLOSE,
    DOOR_OPEN,
    LAMP_OFF,
    LAMP_ON,
    SHIELD_COVER,
    SHIELD_UNCOVER,
    Door,
    Missed,
    Shield,
    Shoot,
    Switch,
    Timed,
    at,
)
from labrig.acquire.by_hand import ByHand, TakenBack
from labrig.acquire.connections import Connections
from labrig.acquire.findings import Finding
from labrig.acquire.part import PartUnit
from labrig.acquire.planner import MOST_STEPS, Plan, Step, plan
from labrig.acquire.protocol import ProtocolModel, Sample, Unit
from labrig.acquire.registered import load_driver, read_protocol
from labrig.acquire.rig import Rig
from labrig.acquire.rig_file import RigFile, read_rig_file
from labrig.acquire.roles import (
    Camera,
    Checkable,
    Device,
    Guarded,
    Hands,
    KeptAwake,
    Lamp,
    LampShield,
    LedBank,
    LiveView,
    Spectrometer,
    Thermometer,
    TrapDoor,
)
from labrig.acquire.runner import RunObserver, run_units
from labrig.acquire.session import Session
from labrig.acquire.values import CameraOffers, ExposureSettings, Frame

__all__ = [
    "DOOR_CLOSE",
    "DOOR_OPEN",
    "LAMP_OFF",
    "LAMP_ON",
    "MOST_STEPS",
    "SHIELD_COVER",
    "SHIELD_UNCOVER",
    "ByHand",
    "Camera",
    "CameraOffers",
    "Checkable",
    "Connections",
    "Device",
    "Door",
    "ExposureSettings",
    "Finding",
    "Frame",
    "Guarded",
    "Hands",
    "KeptAwake",
    "Lamp",
    "LampShield",
    "LedBank",
    "LiveView",
    "Missed",
    "PartUnit",
    "Plan",
    "ProtocolModel",
    "Rig",
    "RigFile",
    "RunObserver",
    "Sample",
    "Session",
    "Shield",
    "Shoot",
    "Spectrometer",
    "Step",
    "Switch",
    "TakenBack",
    "Thermometer",
    "Timed",
    "TrapDoor",
    "Unit",
    "at",
    "load_driver",
    "plan",
    "read_protocol",
    "read_rig_file",
    "run_units",
]
