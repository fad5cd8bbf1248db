"""Emulated boards: the far end of a serial line, byte by byte."""

from .numato import NumatoBoard

__all__ = ["NumatoBoard"]
