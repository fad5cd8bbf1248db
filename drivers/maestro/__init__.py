"""Pololu Maestro servo controllers, moving a trap door, a lamp shield and a filter wheel."""

from .door import MaestroDoor
from .filter_wheel import MaestroFilterWheel
from .shield import MaestroShield

__all__ = ["MaestroDoor", "MaestroFilterWheel", "MaestroShield"]
