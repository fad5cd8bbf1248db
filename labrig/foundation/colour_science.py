"""colour-science, loaded when it is first needed: it takes seconds."""

from typing import Any

import numpy as np


def load() -> Any:
    """Return the package `colour`; how NumPy prints stays as it is, which `colour` would change."""
    with np.printoptions():
        import colour
    return colour
