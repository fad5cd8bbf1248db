"""Processors that this process may use."""

import os
from contextlib import AbstractContextManager


def n_processors() -> int:
    """Return the number of processors that this process may use, at least 1."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def one_linear_algebra_thread() -> AbstractContextManager[object]:
    """Let the linear algebra of this process compute in one thread meanwhile.

    The matrices of a fit are small, so that threads wait for one another more than they compute,
    and where another program computes, too, up to sixty times as long. The command line sets
    this for good before NumPy is loaded; in somebody's notebook it holds for labrig's fits alone.

    Returns
    -------
    context manager
        Restores the number of threads at its end.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.foundation.processors import one_linear_algebra_thread
    >>> with one_linear_algebra_thread():
    ...     print(np.linalg.qr(np.eye(2)).R[0, 0])
    1.0
    """
    # Not above: most of what asks for processors does not fit.
    from threadpoolctl import threadpool_limits

    limited: AbstractContextManager[object] = threadpool_limits(limits=1, user_api="blas")
    return limited
