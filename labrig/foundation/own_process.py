"""Processes of labrig's own beside the one that a person has started."""

import subprocess
import sys
from typing import Any


def own_process(
    module: str, *arguments: str, windows_flags: str = "", **streams: Any
) -> "subprocess.Popen[Any]":
    """Start a module of labrig as a process that Ctrl-C in the terminal does not reach.

    Parameters
    ----------
    module
        Name of the module, such as `labrig.watch.previews`.
    arguments
        Its arguments.
    windows_flags
        Name of a further creation flag in `subprocess`, such as `DETACHED_PROCESS`; for Windows.
    streams
        Standard streams and environment, as `subprocess.Popen` takes them.

    Returns
    -------
    subprocess.Popen
        The process, which belongs to whoever started it.

    Examples
    --------
    >>> import subprocess
    >>> from labrig.foundation.own_process import own_process
    >>> version = own_process("labrig", "--version", stdout=subprocess.PIPE, text=True)
    >>> version.communicate()[0].split()[0], version.returncode
    ('labrig', 0)
    """
    return subprocess.Popen(
        # -P: nothing that lies in the working folder is taken for a module.
        [sys.executable, "-P", "-m", module, *arguments],
        start_new_session=sys.platform != "win32",
        creationflags=_flag("CREATE_NEW_PROCESS_GROUP") | _flag(windows_flags),
        **streams,
    )


def _flag(name: str) -> int:
    """Return a creation flag, which only Windows has."""
    return int(getattr(subprocess, name, 0))
