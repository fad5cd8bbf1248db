"""labrig: from a lab bench to a measured phosphorescent or fluorescent material.

All that a notebook needs is here::

    import labrig

    result = labrig.read_result("runs/2026-01-01T00-00-00_decay_blue-paint")
    patch = result.patches["sample"]
    print(patch.fit.rates)
    fit = labrig.fit_series(patch.series, states=2)

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import lazy_loader

# So that `labrig --help` answers at once.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
