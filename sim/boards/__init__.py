"""Emulated boards: the far end of a serial line, byte by byte."""

from .arduino import ArduinoBoard
from .changer import ChangerBoard
from .cornerstone import CornerstoneBoard
from .dc4100 import Dc4100Board
from .fw102c import Fw102cBoard
from .lcus import LcusBoard
from .maestro import MaestroBoard, Pulse
from .numato import NumatoBoard
from .serial_cable import SerialCable

__all__ = [
    "ArduinoBoard",
    "ChangerBoard",
    "CornerstoneBoard",
    "Dc4100Board",
    "Fw102cBoard",
    "LcusBoard",
    "MaestroBoard",
    "NumatoBoard",
    "Pulse",
    "SerialCable",
]
