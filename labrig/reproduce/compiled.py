"""Modules of compiled functions, which need the extra `labrig[render]`."""

import os
import stat
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from labrig.foundation.errors import UsageError

#: File of the working folder by which Numba is configured, whoever put it there.
NUMBA_CONFIGURATION = ".numba_config.yaml"


def compiled(name: str) -> Any:
    """Return a module of this package; functions are compiled, or read from the cache, when used.

    The cache holds pickles, which can run anything when they are read. It is therefore in a folder
    of this user's own, into which nobody else can write.

    Raises
    ------
    UsageError
        The extra is missing, or the working folder has a configuration of Numba, which somebody
        else may have written.
    """
    try:
        _set_cache_folder()
        return import_module(f"labrig.reproduce.{name}")
    except ModuleNotFoundError as error:
        raise UsageError(
            f"labrig.reproduce needs an extra ({error.name} is missing): pip install "
            "'labrig[render]'"
        ) from None


@cache
def _set_cache_folder() -> None:
    if "numba" not in sys.modules and Path(NUMBA_CONFIGURATION).exists():
        raise UsageError(
            f"{NUMBA_CONFIGURATION}: expected no configuration of Numba in the working folder, "
            "which may come from somebody else; delete it, or start labrig elsewhere"
        )
    import numba
    from platformdirs import user_cache_path

    if "NUMBA_CACHE_DIR" in os.environ:
        return
    folder = user_cache_path("labrig", appauthor=False) / "numba"
    # Where it cannot be made this user's own, Numba keeps them beside labrig's own code.
    numba.config.CACHE_DIR = str(folder) if _is_own(folder) else os.devnull


def _is_own(folder: Path) -> bool:
    """Make a folder into which this user alone can write; return whether that succeeded."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not hasattr(os, "getuid"):
            return True
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
            return False
        folder.chmod(0o700)
    except OSError:
        return False
    return True
