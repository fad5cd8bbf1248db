"""Emulated boards: the far end of a serial line, byte by byte."""

from .changer import ChangerBoard
from .lcus import LcusBoard
from .maestro import MaestroBoard, Pulse
from .numato import NumatoBoard
from .serial_cable import SerialCable

__all__ = ["ChangerBoard", "LcusBoard", "MaestroBoard", "NumatoBoard", "Pulse", "SerialCable"]
