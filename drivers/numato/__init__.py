"""Numato boards: relays that switch a lamp, and analogue inputs that read a thermometer."""

from .relay import NumatoRelay
from .thermometer import NumatoThermometer

__all__ = ["NumatoRelay", "NumatoThermometer"]
