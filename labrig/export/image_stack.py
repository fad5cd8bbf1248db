"""A decay as one TIFF for image programs: linear values of every frame, times in its labels."""

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.activity import counted
from labrig.foundation.errors import UsageError
from labrig.foundation.output_file import replaced
from labrig.reduce import SeriesFrame, cell_means_dn, read_raw, sensor_layout, small

Picture = NDArray[np.float32]
#: Size of a file from which ImageJ's format has no offsets.
MAX_BYTES = 4_000_000_000


def write_image_stack(
    path: Path,
    frames: Sequence[SeriesFrame],
    darks: Sequence[SeriesFrame],
    width: int | None = None,
) -> tuple[int, ...]:
    """Write frames as a hyperstack of ImageJ: time by channel by rows by columns, in DN/s.

    Values are means of the pixels of one colour in each cell of the colour filter, above black and
    above the mean dark frame of the same exposure time, divided by the exposure time. Nothing is
    interpolated between pixels, clipped or scaled.

    Parameters
    ----------
    path
        Path of the TIFF.
    frames
        Frames of the glow; the label of each is its start after lamp off and its exposure time.
    darks
        Dark frames; where none has a frame's exposure time, the black level alone is subtracted.
    width
        Width in pixels to which pictures are averaged; None keeps one pixel for each cell.

    Returns
    -------
    tuple of int
        Shape of the stack: times, channels, rows, columns.

    Raises
    ------
    UsageError
        There are no frames, or the file would have more than 4 GB.
    FrameError
        A frame cannot be read.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.analyse import Overrides, intact_frames
    >>> from labrig.export import write_image_stack
    >>> frames = intact_frames(labrig.read_run("runs/decay"), Overrides())
    >>> write_image_stack(Path("decay.tif"), frames.decay, frames.dark)
    (18, 3, 32, 48)
    """
    import tifffile  # loads slowly

    if not frames:
        raise UsageError("expected frames of a decay, got none; go on with labrig resume")
    names = sensor_layout(frames[0]).channels
    pictures = _pictures(frames, darks, width)
    first = next(pictures)
    rows, columns, channels = first.shape
    shape = (len(frames), channels, rows, columns)
    if 4 * int(np.prod(shape, dtype=np.int64)) > MAX_BYTES:
        raise UsageError(
            f"{path}: expected at most 4 GB, which ImageJ can open, got {len(frames)} pictures of "
            f"{columns} × {rows} pixels; choose a smaller '--width'"
        )
    planes = chain.from_iterable(np.moveaxis(each, -1, 0) for each in chain([first], pictures))
    with replaced(path) as draft:
        tifffile.imwrite(
            draft,
            planes,
            shape=shape,
            dtype=np.float32,
            imagej=True,
            metadata={
                "axes": "TCYX",
                "unit": "pixel",
                "Labels": [
                    f"{channel} t={frame.t_s:.4f} s exposure={frame.exposure_s:.6g} s"
                    for frame in frames
                    for channel in names
                ],
                "Info": "values in DN/s above black and dark; t is the start after lamp off",
            },
        )
    return shape


def _pictures(
    frames: Sequence[SeriesFrame], darks: Sequence[SeriesFrame], width: int | None
) -> Iterator[Picture]:
    """Yield the picture of each frame in DN/s, shape (rows, columns, channels)."""
    dark_dn: dict[float, Picture] = {}
    for exposure_s in {frame.exposure_s for frame in frames}:
        own = [dark for dark in darks if np.isclose(dark.exposure_s, exposure_s, rtol=1e-3)]
        if own:
            means = (cell_means_dn(read_raw(dark.path)) for dark in own)
            dark_dn[exposure_s] = np.mean(list(means), axis=0, dtype=np.float32)
    for frame in counted(frames, "reading frames"):
        light = cell_means_dn(read_raw(frame.path))
        light -= dark_dn.get(frame.exposure_s, np.float32(0))
        yield _shown(light / np.float32(frame.exposure_s), width)


def _shown(picture: Picture, width: int | None) -> Picture:
    return picture if width is None else small(picture, width).astype(np.float32)
