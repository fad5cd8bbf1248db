"""A run while it happens, seen from outside the dark room."""

from labrig.watch.previews import Previews, Seen
from labrig.watch.server import watch_run

__all__ = ["Previews", "Seen", "watch_run"]
