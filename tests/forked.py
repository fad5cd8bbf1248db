"""A process of its own that has all of labrig imported from the start."""

import os
from collections.abc import Callable
from pathlib import Path

#: Of a child that did not get as far as an exit code.
BROKEN = 70


def forked(run: Callable[[], int], said: Path) -> int:
    """Id of a child of this process that ends with `run`'s exit code; `said` has what it says.

    That is its standard error; its standard output goes nowhere.
    """
    pid = os.fork()
    if pid == 0:
        code = BROKEN
        try:
            with said.open("wb") as err, Path(os.devnull).open("wb") as out:
                os.dup2(err.fileno(), 2)
                os.dup2(out.fileno(), 1)
            code = run()
        finally:
            os._exit(code)
    return pid
