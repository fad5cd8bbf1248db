"""Films of rendered frames, made by ffmpeg where it is installed."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import DiskError, UsageError
from labrig.foundation.output_file import replaced

Bytes = NDArray[np.uint8]

SUFFIX = ".mp4"
#: Constant rate factor of H.264: no loss is seen, dark gradients included.
_QUALITY = 14
#: H.264 has frames of even sizes; its colours are those of BT.709, whose primaries are sRGB's.
_FILTER = "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv"


def require_ffmpeg(path: Path) -> str:
    """Return the program ffmpeg, before anything is rendered for a film.

    Parameters
    ----------
    path
        Path of the film, which ends in `.mp4`.

    Returns
    -------
    str
        Path of the program.

    Raises
    ------
    UsageError
        The path has another ending, or ffmpeg is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.errors import UsageError
    >>> from labrig.reproduce import require_ffmpeg
    >>> try:
    ...     require_ffmpeg(Path("glow.gif"))
    ... except UsageError as error:
    ...     print(error)
    glow.gif: expected a film's name that ends in .mp4
    """
    if path.suffix.lower() != SUFFIX:
        raise UsageError(f"{path}: expected a film's name that ends in {SUFFIX}")
    program = shutil.which("ffmpeg")
    if program is None:
        raise UsageError(
            f"{path}: a film needs ffmpeg, which is not on the PATH; install it, or leave the film "
            "out: all frames are pictures of their own, too"
        )
    return program


def write_video(path: Path, frames: Iterable[Bytes], frames_per_s: float) -> None:
    """Write frames as a film in H.264, which browsers play.

    Parameters
    ----------
    path
        Path of the film, which ends in `.mp4`; it is replaced when it is whole.
    frames
        Pictures in sRGB, shape (height, width, 3) each, all of one size; at least one.
    frames_per_s
        Frames of each second, above 0.

    Raises
    ------
    UsageError
        Ffmpeg is not installed, there is no frame, one has another size, or the rate is not above
        0.
    DiskError
        Ffmpeg could not write the film.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.foundation.errors import UsageError
    >>> from labrig.reproduce import write_video
    >>> frames = [np.full((4, 6, 3), grey, np.uint8) for grey in (0, 255)]
    >>> try:
    ...     write_video(Path("glow.mp4"), frames, frames_per_s=0.0)
    ... except UsageError as error:
    ...     print(error)
    expected frames per second above 0, got 0
    """
    if not 0 < frames_per_s < np.inf:
        raise UsageError(f"expected frames per second above 0, got {frames_per_s:g}")
    program = require_ffmpeg(path)
    remaining = iter(frames)
    first = next(remaining, None)
    if first is None:
        raise UsageError(f"{path}: expected at least one frame, got none")
    with replaced(path) as draft, tempfile.TemporaryFile() as complaints:
        command = _command(program, first.shape, frames_per_s, draft)
        with _running(command, complaints) as process:
            assert process.stdin is not None
            is_fed = _fed(process.stdin, chain([first], remaining), first.shape)
        if process.returncode or not is_fed:
            raise DiskError(f"{path}: ffmpeg could not write it ({_last_line(complaints)})")


def _command(program: str, shape: tuple[int, ...], frames_per_s: float, draft: Path) -> list[str]:
    """Return the command that makes a film of raw frames on its input."""
    height, width = shape[:2]
    return [
        program, "-hide_banner", "-loglevel", "error", "-nostdin", "-y",
        "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
        "-framerate", f"{frames_per_s:g}", "-i", "-",
        "-vf", _FILTER, "-c:v", "libx264", "-crf", str(_QUALITY), "-pix_fmt", "yuv420p",
        "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1",
        "-movflags", "+faststart", os.fspath(draft),
    ]  # fmt: skip


@contextmanager
def _running(command: list[str], complaints: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """Run ffmpeg until its input ends; what interrupts labrig ends it, too."""
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=complaints
    )
    try:
        yield process
        process.wait()
    finally:
        process.kill()
        process.wait()


def _fed(pipe: IO[bytes], frames: Iterable[Bytes], shape: tuple[int, ...]) -> bool:
    """Write the frames into a pipe and close it; return whether it took them all."""
    try:
        with pipe:
            for number, frame in enumerate(frames, start=1):
                if frame.shape != shape or frame.dtype != np.uint8 or frame.shape[2:] != (3,):
                    raise UsageError(
                        f"expected frames of bytes of one shape (height, width, 3), {shape}, got "
                        f"{frame.dtype} of {frame.shape} as frame {number}"
                    )
                pipe.write(np.ascontiguousarray(frame).tobytes())
    except BrokenPipeError:
        return False
    return True


def _last_line(complaints: IO[bytes]) -> str:
    complaints.seek(0)
    lines = complaints.read().decode("utf-8", errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
