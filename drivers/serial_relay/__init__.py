"""Any relay board on a serial line: its commands and answers are in the rig file."""

from .led_bank import SerialLedBank
from .relay import SerialRelay

__all__ = ["SerialLedBank", "SerialRelay"]
