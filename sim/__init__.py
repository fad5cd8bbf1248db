"""The simulated dark room: physics of its own, and boards that speak the real protocols."""

if __name__ != "labrig.sim":
    raise ImportError("this package is labrig.sim; import it by that name")

from .opening import OpenRoom, open_room
from .simulation import Simulation

__all__ = ["OpenRoom", "Simulation", "open_room"]
