"""Frames reduced while their run is recorded, so that its result is ready soon after the last one.

A process of its own, which gets the processors only while nothing else wants them, processes the
run folder as it is, again and again while frames come, and throws away what it makes. Frames that
it has reduced are kept in the run folder, where the run's own processing finds them. Nothing
depends on it: what it has not done is done then.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired

from labrig.foundation.own_process import own_process
from labrig.record import Begun, RunSize
from labrig.reduce import WORTHWHILE_BYTES

#: Time in which it writes what it has reduced, before it is killed.
ENDS_WITHIN_S = 5.0


@contextmanager
def reduced_ahead(*, wanted: bool = True) -> Iterator[Begun]:
    """Reduce the frames of runs that are recorded meanwhile.

    Parameters
    ----------
    wanted
        Whether to do so; a run of few or small frames is left out in any case.

    Yields
    ------
    callable
        To be called with the folder of a run that begins and the size of what is to be recorded.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.process import reduced_ahead
    >>> from labrig.record import RunSize
    >>> with reduced_ahead() as begun:
    ...     begun(Path("runs/decay"), RunSize.expected(frames=20, frame_bytes=1000, patches=1))
    """
    processes: list[Popen[bytes]] = []

    def begun(folder: Path, size: RunSize) -> None:
        if wanted and size.frames_bytes >= WORTHWHILE_BYTES:
            with suppress(OSError):  # the system has no room for one more
                processes.append(_started(folder))

    try:
        yield begun
    finally:
        for process in processes:
            _end(process)


def _started(folder: Path) -> Popen[bytes]:
    # It ends with its standard input, and so however this process ends.
    return own_process(
        "labrig.process.ahead_process",
        str(folder),
        windows_flags="IDLE_PRIORITY_CLASS",
        stdin=PIPE,
        stdout=DEVNULL,
        stderr=DEVNULL,
    )


def _end(process: Popen[bytes]) -> None:
    assert process.stdin is not None
    with suppress(OSError):
        process.stdin.close()
    try:
        process.wait(ENDS_WITHIN_S)
    except TimeoutExpired:
        process.kill()
        process.wait()
