"""Processes that decode and reduce frames, as many as fit into the memory set aside for them.

LibRaw writes its messages to the stderr of the process, so that one process decodes one frame at a
time. The processes are started anew rather than forked or spawned from this one's main module, so
that a script or a notebook needs no precautions, on any system.
"""

import os
import pickle
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from subprocess import PIPE, Popen
from typing import IO, Any, Protocol, TypeVar

from labrig.foundation.errors import DataError
from labrig.foundation.input_file import file_size_bytes
from labrig.foundation.own_process import own_process
from labrig.foundation.processors import n_processors
from labrig.foundation.signals import name_of
from labrig.reduce.raw import RawFrame, read_raw
from labrig.reduce.workers.kept import encoded

Reduced_co = TypeVar("Reduced_co", covariant=True)


class Reduction(Protocol[Reduced_co]):
    """A reduction of frames: a frozen dataclass that can be imported by its name.

    Its fields are all that the outcome depends on besides the frames. They and the outcome, whose
    type is annotated, are values as `labrig.reduce.workers.kept` describes them.
    """

    def __call__(self, frames: Iterator[RawFrame], /) -> Reduced_co:
        """Reduce frames; each is decoded when it is asked for."""


def reduced_text(paths: Sequence[Path], reduction: Reduction[Any]) -> str:
    """Decode frames and return what is made of them as text.

    Raises
    ------
    DataError
        A frame is damaged or cannot be reduced.
    UsageError, DiskError
        A frame cannot be read.
    """
    frames = (read_raw(path) for path in paths)
    if len(paths) != 1:
        return encoded(reduction(frames))
    raw = next(frames)
    try:
        return encoded(reduction(iter((raw,))))
    except DataError as error:
        raise type(error)(f"{paths[0]}: {error}") from None


#: Memory of this process and its workers together, and that of this process alone, in bytes.
MEMORY_BYTES, OWN_BYTES = 1_000_000_000, 400_000_000
#: Memory of a worker without frames in bytes, and with one, per byte of its file.
WORKER_BYTES, BYTES_PER_FILE_BYTE = 120_000_000, 7
#: Size of all files together, in bytes, from which starting a worker is worth its second.
WORTHWHILE_BYTES = 100_000_000
#: Interval of checks for Ctrl-C, which does not interrupt a wait on Windows.
_CHECK_INTERVAL_S = 0.2

Paths = Sequence[Path]


def worker_count(groups: Sequence[Paths]) -> int:
    """Return the number of workers that are worth their start; 0 or 1 if there is little to do.

    Parameters
    ----------
    groups
        Paths of the frames that are reduced together.
    """
    sizes = [[file_size_bytes(path) for path in group] for group in groups]
    if sum(map(sum, sizes)) < WORTHWHILE_BYTES:
        return 0
    largest = max(max(group, default=0) for group in sizes)
    worker_bytes = WORKER_BYTES + BYTES_PER_FILE_BYTE * largest
    fitting = (MEMORY_BYTES - OWN_BYTES) // worker_bytes
    return min(n_processors(), fitting, len(groups))


def texts_from_workers(
    groups: Sequence[Paths], reduction: Reduction[Any], workers: int
) -> Iterator[str]:
    """Reduce groups of frames in workers and yield what is made of them in their order.

    Raises
    ------
    DataError
        A frame is damaged or cannot be reduced, or a worker was killed.
    UsageError, DiskError
        A frame cannot be read.
    """
    free: SimpleQueue[_Worker] = SimpleQueue()
    running: list[_Worker] = []

    def reduced(paths: Paths) -> str:
        worker = free.get()
        try:
            return worker.reduced(paths)
        finally:
            free.put(worker)

    executor = ThreadPoolExecutor(workers)
    try:
        for _ in range(workers):
            running.append(_Worker(reduction))
            free.put(running[-1])
        for future in [executor.submit(reduced, paths) for paths in groups]:
            yield _result(future)
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        for worker in running:
            worker.close()
        executor.shutdown()


def _import_path() -> str:
    """Return where this process imports from, without its working folder ('')."""
    folders = (entry for entry in sys.path if isinstance(entry, str) and entry)
    return os.pathsep.join(folders)


def _result(future: "Future[str]") -> str:
    while not future.done():
        wait([future], _CHECK_INTERVAL_S)
    return future.result()


class _Worker:
    """A process that applies one reduction, one group of frames at a time."""

    def __init__(self, reduction: Reduction[Any]) -> None:
        self._process: Popen[bytes] = own_process(
            "labrig.reduce.workers.process",
            stdin=PIPE,
            stdout=PIPE,
            # A notebook has not set what the command line does: see `one_linear_algebra_thread`.
            env={"OPENBLAS_NUM_THREADS": "1", **os.environ, "PYTHONPATH": _import_path()},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._questions: IO[bytes] = self._process.stdin
        self._answers: IO[bytes] = self._process.stdout
        self._ask(reduction)

    def reduced(self, paths: Paths) -> str:
        """Return what the worker makes of a group of frames.

        Raises
        ------
        LabrigError
            The frames cannot be reduced.
        DataError
            The worker was killed.
        """
        self._ask([str(path) for path in paths])
        try:
            answer = pickle.load(self._answers)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise DataError(self._end_text(paths)) from None
        if isinstance(answer, Exception):
            raise answer
        return str(answer)

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._questions, self._answers):
            with suppress(OSError):
                pipe.close()

    def _ask(self, question: Any) -> None:
        with suppress(OSError):  # it has ended, which its answer shows
            pickle.dump(question, self._questions)
            self._questions.flush()

    def _end_text(self, paths: Paths) -> str:
        code = self._process.wait()
        ending = f"was killed by {name_of(-code)}" if code < 0 else f"ended with code {code}"
        return (
            f"{paths[0]}: the process that decoded it {ending}, as when memory runs out; close "
            "other programs and try again"
        )
