"""Whether the errors of results are as large as their σ."""

import numpy as np
from numpy.typing import ArrayLike

#: Largest factor between the errors and σ: the root of 1.2, so that σ which is 20 % too large or
#: too small lies outside whatever the rms of the errors at hand is.
WITHIN = np.sqrt(1.2)
#: Fewest errors whose rms, whose standard error is 1/√(2n), tells σ that is right from wrong.
FEWEST = 60


def assert_sigma_is_right(pulls: ArrayLike) -> None:
    """Check that the rms of errors, each in its σ, is one within the root of 1.2.

    Parameters
    ----------
    pulls
        Errors over their σ, 60 or more, of as many independent results as there can be.
    """
    every = np.ravel(np.asarray(pulls, dtype=float))
    assert every.size >= FEWEST
    rms = float(np.sqrt(np.mean(np.square(every))))
    assert 1 / WITHIN < rms < WITHIN, f"rms of {every.size} errors over their σ: {rms:.3f}"
