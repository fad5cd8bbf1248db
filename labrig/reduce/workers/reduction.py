"""One way from frames on disk to what is wanted of them: decoded, reduced and kept.

Frames are decoded and reduced together, where there is much to do in processes of their own, so
that no mosaic leaves the process that decoded it. What is reduced from frames with a checksum is
kept in their run folder and taken from there the next time.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar, get_type_hints

from labrig.foundation.activity import counted
from labrig.record import FRAMES
from labrig.reduce.workers.kept import ReductionCache, decoded
from labrig.reduce.workers.pool import Reduction, reduced_text, texts_from_workers, worker_count

Reduced = TypeVar("Reduced")


class StoredFrame(Protocol):
    """A frame on disk."""

    @property
    def path(self) -> Path:
        """Path of the file."""

    @property
    def sha256(self) -> str:
        """Checksum of the file by its run's journal; empty if there is none."""


class Exposure(StoredFrame, Protocol):
    """A frame on disk with its exposure time."""

    @property
    def exposure_s(self) -> float:
        """Exposure time in seconds."""


def reduce_frames(frames: Sequence[StoredFrame], reduction: Reduction[Reduced]) -> list[Reduced]:
    """Reduce each frame by itself.

    Parameters
    ----------
    frames
        Frames on disk.
    reduction
        What is to be made of each of them.

    Returns
    -------
    list
        The outcome for each frame, in their order.

    Raises
    ------
    DataError
        A frame is damaged or cannot be reduced, or a process that decodes frames was killed.
    UsageError, DiskError
        A frame cannot be read.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import BrightPixels, reduce_frames
    >>> darks = labrig.read_run("runs/decay").frames("dark")[-4:]
    >>> [bright.pixels.places.size for bright in reduce_frames(darks, BrightPixels())]
    [1, 1, 1, 1]
    """
    return reduce_groups([(frame,) for frame in frames], reduction)


def reduce_groups(
    groups: Sequence[Sequence[StoredFrame]], reduction: Reduction[Reduced]
) -> list[Reduced]:
    """Reduce each group of frames together.

    Parameters
    ----------
    groups
        Groups of frames on disk, such as pairs.
    reduction
        What is to be made of each of them.

    Returns
    -------
    list
        The outcome for each group, in their order.

    Raises
    ------
    DataError
        A frame is damaged or cannot be reduced, or a process that decodes frames was killed.
    UsageError, DiskError
        A frame cannot be read.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import BrightPixels, reduce_groups
    >>> darks = labrig.read_run("runs/decay").frames("dark")[-4:]
    >>> first, second = reduce_groups([darks[:1], darks[1:2]], BrightPixels())
    >>> first.pixels.places.size, second.pixels.places.size
    (1, 1)
    """
    kept = _kept_reductions(groups, reduction)
    kind = get_type_hints(type(reduction).__call__)["return"]
    outcomes = {
        number: outcome
        for number, group in enumerate(groups)
        if (outcome := _kept_outcome(kept, group, kind)) is not None
    }
    missing = [number for number in range(len(groups)) if number not in outcomes]
    try:
        texts = _texts([groups[number] for number in missing], reduction)
        numbered = zip(missing, texts, strict=True)
        for number, text in counted(numbered, "reducing frames", len(missing)):
            outcomes[number] = decoded(text, kind)
            if (folder := _folder(groups[number])) is not None:
                kept[folder].add(_key(groups[number]), text)
    finally:
        for folder_reductions in kept.values():
            folder_reductions.write()
    return [outcomes[number] for number in range(len(groups))]


def _kept_reductions(
    groups: Sequence[Sequence[StoredFrame]], reduction: Reduction[Any]
) -> dict[Path, ReductionCache]:
    """Read what was kept of the frames' runs."""
    folders = {folder for group in groups if (folder := _folder(group)) is not None}
    return {folder: ReductionCache(folder, reduction) for folder in folders}


def _folder(group: Sequence[StoredFrame]) -> Path | None:
    """Return the run folder of frames; None if they are in none, or have no checksums."""
    is_of_a_run = all(frame.sha256 and frame.path.parent.name == FRAMES for frame in group)
    return group[0].path.parent.parent if group and is_of_a_run else None


def _key(group: Sequence[StoredFrame]) -> str:
    return "+".join(frame.sha256 for frame in group)


def _kept_outcome(
    kept: Mapping[Path, ReductionCache], group: Sequence[StoredFrame], kind: Any
) -> Any:
    """Return what was kept of a group of frames; None if there is nothing that can be used."""
    folder = _folder(group)
    text = None if folder is None else kept[folder].get(_key(group))
    try:
        return None if text is None else decoded(text, kind)
    except ValueError:
        return None


def _texts(groups: Sequence[Sequence[StoredFrame]], reduction: Reduction[Any]) -> Iterator[str]:
    """Reduce groups of frames in as many processes as it is worth, and yield the texts in order."""
    paths = [tuple(frame.path for frame in group) for group in groups]
    workers = worker_count(paths)
    if workers < 2:
        return (reduced_text(group, reduction) for group in paths)
    return texts_from_workers(paths, reduction, workers)
