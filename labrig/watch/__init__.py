"""A run while it happens, seen from outside the dark room."""

from labrig.watch.previews import Glances, Seen
from labrig.watch.server import watch_run

__all__ = ["Glances", "Seen", "watch_run"]
