"""Frames decoded and reduced in this process."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from labrig.foundation.errors import DataError
from labrig.reduce.kept_reductions import encoded
from labrig.reduce.raw import RawFrame, read_raw

Reduced_co = TypeVar("Reduced_co", covariant=True)


class Reduction(Protocol[Reduced_co]):
    """A reduction of frames: a frozen dataclass that can be imported by its name.

    Its fields are all that the outcome depends on besides the frames. They and the outcome, whose
    type is annotated, are values as `labrig.reduce.kept_reductions` describes them.
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
