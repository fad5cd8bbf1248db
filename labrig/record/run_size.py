"""Size of a run on disk: expected before it, measured after it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from labrig.foundation.errors import DiskError

#: Journal, tables and NeXus file, per frame; report, figures and fits, per patch; and what is kept
#: of the pictures in the report, for the next processing.
RECORDS_PER_FRAME_BYTES = 5_000
RESULTS_PER_PATCH_BYTES = 2_000_000
PICTURES_BYTES = 10_000_000


@dataclass(frozen=True)
class RunSize:
    """Size of a run folder.

    Attributes
    ----------
    frames
        Number of frames.
    frames_bytes
        Size of the frames in bytes.
    results_bytes
        Size of all else in bytes: journal, notes, results, what is kept of reduced frames.
    """

    frames: int
    frames_bytes: int
    results_bytes: int

    @classmethod
    def expected(cls, frames: int, frame_bytes: int, patches: int) -> Self:
        """Return the size to be expected of a run with that many frames and patches."""
        results_bytes = frames * RECORDS_PER_FRAME_BYTES + patches * RESULTS_PER_PATCH_BYTES
        return cls(frames, frames * frame_bytes, results_bytes + PICTURES_BYTES)

    @classmethod
    def measured(cls, folder: Path) -> Self:
        """Return the size of a run folder, the results of earlier processing included.

        Raises
        ------
        DiskError
            The disk cannot be read.
        """
        try:
            sizes = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
        except OSError as error:
            raise DiskError(f"{folder}: its size cannot be read ({error.strerror})") from None
        frames = [size for path, size in sizes.items() if path.parent == folder / "frames"]
        return cls(len(frames), sum(frames), sum(sizes.values()) - sum(frames))

    @property
    def total_bytes(self) -> int:
        """Size of all in bytes."""
        return self.frames_bytes + self.results_bytes

    def __str__(self) -> str:
        return (
            f"{size_text(self.total_bytes)} on disk ({self.frames} frames "
            f"{size_text(self.frames_bytes)}, all else {size_text(self.results_bytes)})"
        )


def size_text(size_bytes: float) -> str:
    """Format a size.

    Parameters
    ----------
    size_bytes
        Size in bytes.

    Returns
    -------
    str
        Text such as `1.57 GB` or `20 kB`, to three digits.

    Examples
    --------
    >>> from labrig.record import size_text
    >>> size_text(152_460_000)
    '152 MB'
    """
    for factor, unit in ((1e9, "GB"), (1e6, "MB")):
        if size_bytes >= factor:
            return f"{size_bytes / factor:.3g} {unit}"
    return f"{size_bytes / 1e3:.0f} kB"
