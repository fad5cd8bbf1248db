from .previews import (
    Previews as Previews,
    RenderedPreview as RenderedPreview,
)
from .server import (
    watch_run as watch_run,
)
