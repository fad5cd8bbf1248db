"""Emulated boards: the far end of a serial line, byte by byte."""

from .numato import NumatoBoard
from .serial_cable import SerialCable

__all__ = ["NumatoBoard", "SerialCable"]
