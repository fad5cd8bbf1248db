"""A run while it happens, seen from outside the dark room."""

from labrig.watch.following import Following
from labrig.watch.glance import Glance, glance

__all__ = ["Following", "Glance", "glance"]
