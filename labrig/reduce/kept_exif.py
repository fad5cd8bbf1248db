"""EXIF of the frames of a run, read once and kept in the run folder for the next time."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import open_regular
from labrig.record import FRAMES
from labrig.reduce.frame_reduction import StoredFrame
from labrig.reduce.kept_reductions import KeptReductions, decoded, encoded
from labrig.reduce.raw import Exif, read_exif


@dataclass(frozen=True)
class ReadExif:
    """Reading of EXIF alone, without the picture."""


def frames_exif(frames: Sequence[StoredFrame]) -> list[Exif]:
    """Return the EXIF of frames; of a frame that cannot be read or has none, nothing is in it.

    Parameters
    ----------
    frames
        Frames on disk.

    Returns
    -------
    list of Exif
        Settings, camera and time of each frame.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import frames_exif
    >>> glow = labrig.read_run("runs/decay").frames("decay")
    >>> [exif.exposure_s for exif in frames_exif(glow[:2])]
    [0.5, 0.5]
    """
    folders = {frame.path.parent.parent for frame in frames if frame.path.parent.name == FRAMES}
    kept = {folder: KeptReductions(folder, ReadExif()) for folder in folders}
    read = [_exif(frame, kept.get(frame.path.parent.parent)) for frame in frames]
    for reductions in kept.values():
        reductions.write()
    return read


def _exif(frame: StoredFrame, kept: KeptReductions | None) -> Exif:
    text = kept.get(frame.sha256) if kept and frame.sha256 else None
    if text is not None:
        with suppress(ValueError):
            exif: Exif = decoded(text, Exif)
            return exif
    try:
        with open_regular(frame.path) as file:
            exif = read_exif(file)
    except (UsageError, OSError):
        return Exif()
    if kept and frame.sha256:
        kept.add(frame.sha256, encoded(exif))
    return exif
