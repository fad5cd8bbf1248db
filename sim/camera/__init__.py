"""A simulated camera on a simulated USB cable, or on the loopback network.

It is a Canon EOS 5D Mark II, or one that implements nothing but the PTP standard.

`SimulatedCamera(...).backend` is given to pyusb, which then exchanges packets with it;
`PtpIpServer` serves `SimulatedCamera(...).responder` to any program on this PC.
"""

from .body_settings import BodySettings
from .camera import SimulatedCamera
from .faults import CameraFaults
from .pace import Pace
from .photograph import Sensor
from .ptpip.server import PtpIpServer
from .standard.body import StandardHabits

__all__ = [
    "BodySettings",
    "CameraFaults",
    "Pace",
    "PtpIpServer",
    "Sensor",
    "SimulatedCamera",
    "StandardHabits",
]
