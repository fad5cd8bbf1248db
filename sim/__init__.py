"""The simulated dark room: physics of its own, and boards that speak the real protocols."""

from .opening import OpenRoom, open_room

__all__ = ["OpenRoom", "open_room"]
