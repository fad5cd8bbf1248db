"""Pololu Maestro servo controllers, moving trap door, lamp shield, filter wheel, sample changer."""

from .door import MaestroDoor
from .filter_wheel import MaestroFilterWheel
from .sample_changer import MaestroSampleChanger
from .shield import MaestroShield

__all__ = ["MaestroDoor", "MaestroFilterWheel", "MaestroSampleChanger", "MaestroShield"]
