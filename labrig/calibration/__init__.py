"""Calibrations of a bench as files, written by calibration protocols and read by later ones.

To add a kind, write its file's module with its `CalibrationKind` and register that by an entry
point in `labrig.calibrations`: rig files then have its key, and analyses find it by
`Inputs.calibration`.

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
