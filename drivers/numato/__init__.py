"""Numato boards: relays that switch a lamp or LEDs, analogue inputs that read a thermometer."""

from .led_bank import NumatoLedBank
from .relay import NumatoRelay
from .thermometer import NumatoThermometer

__all__ = ["NumatoLedBank", "NumatoRelay", "NumatoThermometer"]
