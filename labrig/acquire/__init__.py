"""Device roles, rig files, protocols and their units, plans and the runner."""

from labrig.acquire import roles
from labrig.acquire.actions import LateAction, ManualStep, TimedAction, UndoManualStep, at
from labrig.acquire.adaptation import Adaptation, Offer, adapted
from labrig.acquire.channels import (
    Board,
    Channel,
    Positions,
    Servo,
    Switch,
    TemperatureSensor,
)
from labrig.acquire.connections import Connections, SerialPort
from labrig.acquire.continuation import Continuation
from labrig.acquire.driver_loading import (
    bank_lights,
    driver_and_settings,
    load_driver,
    require_own_ports,
)
from labrig.acquire.plan_clock import Due, PlanClock, step_text
from labrig.acquire.planner import MAX_STEPS, Plan, Step, plan, planned_rig
from labrig.acquire.port_trouble import PORT_FAILURES, SERVICES, gone, not_opened
from labrig.acquire.protocol import PartUnit, ProtocolModel, Sample, Unit
from labrig.acquire.protocol_file import changes_with_absolute_paths, read_protocol
from labrig.acquire.readback import lights_that_read_back
from labrig.acquire.rig import Rig, in_safe_order
from labrig.acquire.rig_file import (
    CalibrationRules,
    DeviceEntry,
    LampType,
    LuminanceReading,
    Optics,
    RigFile,
    read_rig_file,
)
from labrig.acquire.roles import *  # noqa: F403, a role is listed once, there
from labrig.acquire.roles.role import Finding, Severity
from labrig.acquire.run_plan import (
    EDITED,
    read_result_rig,
    read_run_protocol,
    read_run_rig,
    result_takes_edits,
)
from labrig.acquire.runner import RunObserver, run_units
from labrig.acquire.running_programs import Program, linux_programs, running_programs
from labrig.acquire.session import TOLERANCE_S, Session
from labrig.acquire.values import (
    TYPICAL_BYTES_PER_PIXEL,
    CameraCapabilities,
    ExposureSettings,
    Frame,
    FramePixels,
    frame_bytes,
    shutter_text,
)

__all__ = [
    "EDITED",
    "MAX_STEPS",
    "PORT_FAILURES",
    "SERVICES",
    "TOLERANCE_S",
    "TYPICAL_BYTES_PER_PIXEL",
    "Adaptation",
    "Board",
    "CalibrationRules",
    "CameraCapabilities",
    "Channel",
    "Connections",
    "Continuation",
    "DeviceEntry",
    "Due",
    "ExposureSettings",
    "Finding",
    "Frame",
    "FramePixels",
    "LampType",
    "LateAction",
    "LuminanceReading",
    "ManualStep",
    "Offer",
    "Optics",
    "PartUnit",
    "Plan",
    "PlanClock",
    "Positions",
    "Program",
    "ProtocolModel",
    "Rig",
    "RigFile",
    "RunObserver",
    "Sample",
    "SerialPort",
    "Servo",
    "Session",
    "Severity",
    "Step",
    "Switch",
    "TemperatureSensor",
    "TimedAction",
    "UndoManualStep",
    "Unit",
    "adapted",
    "at",
    "bank_lights",
    "changes_with_absolute_paths",
    "driver_and_settings",
    "frame_bytes",
    "gone",
    "in_safe_order",
    "lights_that_read_back",
    "linux_programs",
    "load_driver",
    "not_opened",
    "plan",
    "planned_rig",
    "read_protocol",
    "read_result_rig",
    "read_rig_file",
    "read_run_protocol",
    "read_run_rig",
    "require_own_ports",
    "result_takes_edits",
    "run_units",
    "running_programs",
    "shutter_text",
    "step_text",
]
__all__ += roles.__all__
