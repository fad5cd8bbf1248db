"""A simulated Canon EOS 5D Mark II on a simulated USB cable.

`SimulatedCamera(...).backend` is given to pyusb, which then talks to it packet by packet.
"""

from .camera import SimulatedCamera
from .faults import CameraFaults
from .sensor import Sensor

__all__ = ["CameraFaults", "Sensor", "SimulatedCamera"]
