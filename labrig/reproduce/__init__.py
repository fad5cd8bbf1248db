"""Reproduction: what a measured material emits where and when it is lit, and pictures of it.

Names are listed in `__init__.pyi`, and loaded when first used. Fields of levels need the extra
`labrig[render]`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
