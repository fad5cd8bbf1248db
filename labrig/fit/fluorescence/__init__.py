"""Re-radiation matrices from photographs under narrow-band lights.

One light after the other, and an RGB camera, after P. McEvoy, *Capture and simulation of
fluorescence in fabrics* (Chalmers, 2020), called the thesis here.

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
