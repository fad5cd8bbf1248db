"""Display of a run while it is recorded, from outside the dark room."""

from labrig.watch.previews import Previews, RenderedPreview
from labrig.watch.server import watch_run

__all__ = ["Previews", "RenderedPreview", "watch_run"]
