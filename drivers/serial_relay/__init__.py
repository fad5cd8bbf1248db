"""Any relay board or filter wheel on a serial line: its commands are in the rig file."""

from .filter_wheel import SerialFilterWheel
from .led_bank import SerialLedBank
from .relay import SerialRelay

__all__ = ["SerialFilterWheel", "SerialLedBank", "SerialRelay"]
