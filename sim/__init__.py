"""The simulated dark room: independent physics, and boards that use the real protocols.

Names are listed in `__init__.pyi`, and loaded when first used: a plan needs the description only.
"""

import lazy_loader

if __name__ != "labrig.sim":
    raise ImportError("this package is labrig.sim; import it by that name")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
