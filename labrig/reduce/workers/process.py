"""A process that decodes and reduces frames for another one.

    python -P -m labrig.reduce.workers.process

It reads from its standard input a reduction and then groups of paths, and answers each on its
standard output with what is made of the frames, as text, or with an error. The end of its input is
its end.
"""

import os
import pickle
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import cv2

from labrig.foundation.errors import LabrigError, memory_shortage
from labrig.reduce.workers.pool import reduced_text

_STDOUT, _STDERR = 1, 2


def main() -> None:
    """Reduce frames until the input ends."""
    answers = os.fdopen(os.dup(_STDOUT), "wb")
    os.dup2(_STDERR, _STDOUT)  # what a library prints is no answer
    cv2.setNumThreads(1)  # there is a process for each CPU
    with suppress(EOFError, BrokenPipeError):  # nobody asks any more
        serve(sys.stdin.buffer, answers)


def serve(questions: BinaryIO, answers: BinaryIO) -> None:
    """Answer every group of paths.

    Raises
    ------
    EOFError
        There are no more questions.
    """
    reduction = pickle.load(questions)
    while True:
        paths = [Path(name) for name in pickle.load(questions)]
        pickle.dump(_answer(paths, reduction), answers)
        answers.flush()


def _answer(paths: list[Path], reduction: Any) -> str | Exception:
    try:
        return reduced_text(paths, reduction)
    except LabrigError as error:
        return error
    except MemoryError as error:
        return memory_shortage(error)
    except Exception:  # a defect: the process that asked raises it
        return RuntimeError(traceback.format_exc())


if __name__ == "__main__":
    main()
