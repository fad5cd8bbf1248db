"""colour-science, loaded when it is first needed: it takes seconds."""

from types import ModuleType

import numpy as np


def load() -> ModuleType:
    """Return the package `colour`; how NumPy prints stays as it is, which `colour` would change."""
    with np.printoptions():
        import colour
    assert isinstance(colour, ModuleType)
    return colour
