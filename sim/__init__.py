"""The simulated dark room: independent physics, and boards that use the real protocols."""

if __name__ != "labrig.sim":
    raise ImportError("this package is labrig.sim; import it by that name")

from .opening import OpenRoom, open_room
from .simulation import Simulation

__all__ = ["OpenRoom", "Simulation", "open_room"]
