"""Devices by role, the rig file, protocols as units, the plan and the runner."""

from labrig.acquire.findings import Finding
from labrig.acquire.planner import Plan, plan
from labrig.acquire.protocol import ProtocolModel, Sample, Unit
from labrig.acquire.rig import Rig
from labrig.acquire.rig_file import RigFile, read_rig_file
from labrig.acquire.roles import (
    Camera,
    Checkable,
    Device,
    KeptAwake,
    Lamp,
    LedBank,
    LiveView,
    Spectrometer,
    TrapDoor,
)
from labrig.acquire.runner import RunObserver, run_units
from labrig.acquire.session import LAMP_OFF, LAMP_ON, Session, Shoot, Switch, Timed, at
from labrig.acquire.values import CameraOffers, ExposureSettings, Frame

__all__ = [
    "LAMP_OFF",
    "LAMP_ON",
    "Camera",
    "CameraOffers",
    "Checkable",
    "Device",
    "ExposureSettings",
    "Finding",
    "Frame",
    "KeptAwake",
    "Lamp",
    "LedBank",
    "LiveView",
    "Plan",
    "ProtocolModel",
    "Rig",
    "RigFile",
    "RunObserver",
    "Sample",
    "Session",
    "Shoot",
    "Spectrometer",
    "Switch",
    "Timed",
    "TrapDoor",
    "Unit",
    "at",
    "plan",
    "read_rig_file",
    "run_units",
]
