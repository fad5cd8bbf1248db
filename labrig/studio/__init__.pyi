from .server import (
    design_on_page as design_on_page,
)
