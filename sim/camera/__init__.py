"""A simulated Canon EOS 5D Mark II on a simulated USB cable, or on the loopback network.

`SimulatedCamera(...).backend` is given to pyusb, which then talks to it packet by packet;
`PtpIpServer` serves `SimulatedCamera(...).responder` to any program on this PC.
"""

from .body_settings import BodySettings
from .camera import SimulatedCamera
from .faults import CameraFaults
from .pace import Pace
from .ptpip_server import PtpIpServer
from .sensor import Sensor

__all__ = ["BodySettings", "CameraFaults", "Pace", "PtpIpServer", "Sensor", "SimulatedCamera"]
