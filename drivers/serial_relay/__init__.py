"""Any relay board, filter wheel or sample changer on a serial line, by the rig file's commands."""

from .filter_wheel import SerialFilterWheel
from .led_bank import SerialLedBank
from .relay import SerialRelay
from .sample_changer import SerialSampleChanger

__all__ = ["SerialFilterWheel", "SerialLedBank", "SerialRelay", "SerialSampleChanger"]
