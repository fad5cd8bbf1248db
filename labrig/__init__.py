"""labrig: control of a lab bench and photometry of phosphorescent and fluorescent materials.

The functions that a notebook needs are exported here::

    import labrig

    result = labrig.read_result("runs/2026-01-01T00-00-00_decay_blue-paint")
    patch = result.patches["sample"]
    print(patch.fit.rates)
    fit = labrig.fit_series(patch.series, states=2)

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import sys

# `python -m labrig` puts the working folder first: nothing in it is imported, whoever put it there.
if sys.argv[:1] == ["-m"] and not sys.flags.safe_path:
    del sys.path[0]

import lazy_loader

# Lazy loading lets `labrig --help` answer at once.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
