"""Results in a notebook: as a page, and as figures that are asked for by name.

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
