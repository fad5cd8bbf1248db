"""Films by ffmpeg: what a stand-in is told and given, and a real one where it is installed."""

import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from labrig.foundation.errors import DiskError, UsageError
from labrig.reproduce import write_video

Bytes = NDArray[np.uint8]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the stand-in is a script with a shebang")

RECORDS = """
import json, sys
pixels = sys.stdin.buffer.read()
with open({record!r}, "w") as record:
    json.dump([sys.argv[1:], pixels.hex()], record)
open(sys.argv[-1], "wb").write(b"film")
"""
FAILS = """
import sys
sys.stdin.buffer.read(10)
print("Unknown encoder 'libx264'", file=sys.stderr)
sys.exit(1)
"""


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Put a script in the place of ffmpeg."""

    def put(script: str) -> None:
        programs = tmp_path / "programs"
        programs.mkdir()
        program = programs / "ffmpeg"
        program.write_text(f"#!{sys.executable} -S\n{script}")
        program.chmod(0o755)
        monkeypatch.setenv("PATH", str(programs))

    return put


def frames(count: int, height: int = 4, width: int = 6) -> Iterator[Bytes]:
    rng = np.random.default_rng(1)
    for _ in range(count):
        yield rng.integers(0, 256, (height, width, 3), dtype=np.uint8)


def test_ffmpeg_gets_all_pixels_and_what_they_are(
    tmp_path: Path, stand_in: Callable[[str], None]
) -> None:
    stand_in(RECORDS.format(record=str(tmp_path / "record")))
    write_video(tmp_path / "glow.mp4", frames(3), frames_per_s=12.5)
    arguments, pixels = json.loads((tmp_path / "record").read_text())
    assert bytes.fromhex(pixels) == b"".join(frame.tobytes() for frame in frames(3))
    source = arguments[: arguments.index("-i")]
    given = dict(
        zip(source[source.index("-f") :: 2], source[source.index("-f") + 1 :: 2], strict=True)
    )
    assert given == {
        "-f": "rawvideo",
        "-pix_fmt": "rgb24",
        "-s": "6x4",
        "-framerate": "12.5",
    }
    assert (tmp_path / "glow.mp4").read_bytes() == b"film"
    assert not list(tmp_path.glob(".*"))


def test_a_film_that_fails_is_one_line_and_leaves_the_old_one(
    tmp_path: Path, stand_in: Callable[[str], None]
) -> None:
    stand_in(FAILS)
    (tmp_path / "glow.mp4").write_bytes(b"old")
    with pytest.raises(DiskError, match=r"^[^\n]*Unknown encoder 'libx264'[^\n]*$"):
        write_video(tmp_path / "glow.mp4", frames(200, 100, 100), 25.0)
    assert (tmp_path / "glow.mp4").read_bytes() == b"old"


def test_without_ffmpeg_one_line_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match=r"^[^\n]*needs ffmpeg[^\n]*$"):
        write_video(tmp_path / "glow.mp4", frames(2), 25.0)


def test_frames_of_several_sizes_are_refused(
    tmp_path: Path, stand_in: Callable[[str], None]
) -> None:
    stand_in(RECORDS.format(record=str(tmp_path / "record")))
    several = [np.zeros((4, 6, 3), np.uint8), np.zeros((4, 4, 3), np.uint8)]
    with pytest.raises(UsageError, match="frame 2"):
        write_video(tmp_path / "glow.mp4", several, 25.0)
    with pytest.raises(UsageError, match="at least one"):
        write_video(tmp_path / "glow.mp4", [], 25.0)
    assert not (tmp_path / "glow.mp4").exists()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_a_film_shows_its_frames(tmp_path: Path) -> None:
    colours = [(30, 40, 60), (200, 120, 30), (0, 0, 0)]
    flat = [np.full((33, 47, 3), colour, np.uint8) for colour in colours]
    write_video(tmp_path / "glow.mp4", flat, frames_per_s=5.0)
    film = cv2.VideoCapture(str(tmp_path / "glow.mp4"))
    for colour in colours:
        good, frame = film.read()
        assert good
        assert frame.shape == (34, 48, 3)
        np.testing.assert_allclose(frame[16, 20, ::-1], colour, atol=3)
    assert not film.read()[0]
