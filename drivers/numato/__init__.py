"""Numato boards: relays that switch lamps or LEDs, analogue inputs that read a thermometer."""

from .lamp_bank import NumatoLampBank
from .led_bank import NumatoLedBank
from .relay import NumatoRelay
from .thermometer import NumatoThermometer

__all__ = ["NumatoLampBank", "NumatoLedBank", "NumatoRelay", "NumatoThermometer"]
