"""Pololu Maestro servo controllers, moving a trap door and a lamp shield."""

from .door import MaestroDoor
from .shield import MaestroShield

__all__ = ["MaestroDoor", "MaestroShield"]
