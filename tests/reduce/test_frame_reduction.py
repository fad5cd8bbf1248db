"""Frames reduced here or in workers, and kept for the next time."""

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from labrig.foundation.errors import DataError, FrameError, UsageError
from labrig.record import own_digest
from labrig.reduce import RawFrame, Reduction, SeriesFrame, reduce_frames, reduce_groups
from labrig.reduce.hot_pixels import HotPixels
from labrig.reduce.measured_frames import MeasureRegions
from labrig.reduce.workers.kept import decoded, encoded
from labrig.reduce.workers.pool import reduced_text, texts_from_workers
from tests.reduce.conftest import WriteDng

HEIGHT, WIDTH = 64, 96
MIDDLE = (0.25, 0.25, 0.5, 0.5)


@dataclass(frozen=True)
class MeanLevel:
    """A reduction of the user's own, of one frame or several."""

    offset_dn: float = 0.0

    def __call__(self, frames: Iterator[RawFrame]) -> float:
        return float(np.mean([raw.mosaic.mean() for raw in frames])) + self.offset_dn


@dataclass(frozen=True)
class KillItself:
    """A reduction that ends as a process that takes too much memory."""

    def __call__(self, frames: Iterator[RawFrame]) -> float:
        os.kill(os.getpid(), signal.SIGKILL)
        return 0.0


@dataclass(frozen=True)
class Nothing:
    """A reduction that finds nothing."""

    def __call__(self, frames: Iterator[RawFrame]) -> None:
        for _ in frames:
            pass


@dataclass(frozen=True)
class ImportPath:
    """A reduction that tells where its process imports from."""

    def __call__(self, frames: Iterator[RawFrame]) -> tuple[str, ...]:
        return tuple(map(str, sys.path))


@pytest.fixture
def run(tmp_path: Path, write_dng: WriteDng) -> Sequence[SeriesFrame]:
    """Frames in a run folder, with their checksums."""
    folder = tmp_path / "run" / "frames"
    folder.mkdir(parents=True)
    frames = []
    for number in range(4):
        rng = np.random.default_rng(number)
        path, content = folder / f"{number:06d}.dng", write_dng(rng.poisson(3000, (HEIGHT, WIDTH)))
        path.write_bytes(content)
        frames.append(SeriesFrame(path, 1.0 * number, 1.0, sha256=sha256(content).hexdigest()))
    return frames


def kept_files(frames: Sequence[SeriesFrame]) -> list[Path]:
    return sorted((frames[0].path.parents[1] / "cache").glob("*"))


@dataclass(frozen=True, eq=False)
class Anything:
    """A value with all that a value may hold."""

    number: float
    whole: int
    text: str | None
    rows: tuple[npt.NDArray[np.float64], ...]
    named: dict[str, npt.NDArray[np.uint16]]


numbers = arrays(np.float64, st.tuples(st.integers(0, 3), st.integers(0, 3)))
levels = arrays(np.uint16, st.integers(0, 5))
values = st.builds(
    Anything,
    st.floats(),
    st.integers(-(2**53), 2**53),
    st.none() | st.text(),
    st.lists(numbers, max_size=3).map(tuple),
    st.dictionaries(st.text(max_size=5), levels, max_size=3),
)


@given(values)
def test_a_value_comes_back_to_the_last_bit(value: Anything) -> None:
    back = decoded(encoded(value), Anything)
    assert isinstance(back, Anything)
    assert np.array_equal([back.number], [value.number], equal_nan=True)
    assert (back.whole, back.text) == (value.whole, value.text)
    assert [row.tobytes() for row in back.rows] == [row.tobytes() for row in value.rows]
    assert [row.shape for row in back.rows] == [row.shape for row in value.rows]
    assert {name: row.tolist() for name, row in back.named.items()} == {
        name: row.tolist() for name, row in value.named.items()
    }


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[1]",
        '{"dtype":"O","shape":[1],"base64":"AAAA"}',
        '{"dtype":"<f8","shape":[1],"base64":"AAAA"}',
        '{"dtype":"<f8","shape":[1],"base64":"?"}',
        '{"dtype":"no kind","shape":[1],"base64":"AAAA"}',
        '{"dtype":"<f8","shape":["x"],"base64":"AAAAAAAAAAA="}',
        "[" * 100_000,
    ],
)
def test_a_text_that_is_no_such_value_is_refused(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        decoded(text, Anything)


def test_workers_reduce_to_the_last_bit_as_this_process(run: Sequence[SeriesFrame]) -> None:
    paths = [(frame.path,) for frame in run]
    hot = HotPixels(HEIGHT, WIDTH, np.array([5, 300]))
    reduction: Reduction[Any] = MeasureRegions((MIDDLE, (0.0, 0.0, 1.0, 1.0)), hot)
    here = [reduced_text(group, reduction) for group in paths]
    assert list(texts_from_workers(paths, reduction, 2)) == here


def test_a_worker_imports_from_where_this_process_does_and_not_from_the_working_folder(
    run: Sequence[SeriesFrame], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    elsewhere = tmp_path / "modules"
    elsewhere.mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", elsewhere, str(elsewhere), *sys.path])
    (text,) = texts_from_workers([(run[0].path,)], ImportPath(), 1)
    folders = decoded(text, tuple[str, ...])
    assert str(elsewhere) in folders
    assert {"", ".", str(tmp_path)}.isdisjoint(folders)


def test_there_is_an_outcome_for_every_group(run: Sequence[SeriesFrame]) -> None:
    assert reduce_frames(run, Nothing()) == [None] * len(run)


def test_a_damaged_frame_is_the_same_error_from_a_worker(run: Sequence[SeriesFrame]) -> None:
    run[2].path.write_bytes(run[2].path.read_bytes()[:3000])
    paths = [(frame.path,) for frame in run]
    with pytest.raises(FrameError) as here:
        [reduced_text(group, MeanLevel()) for group in paths]
    with pytest.raises(FrameError) as there:
        list(texts_from_workers(paths, MeanLevel(), 1))
    assert str(there.value) == str(here.value)
    assert str(run[2].path) in str(there.value)


@pytest.mark.skipif(sys.platform == "win32", reason="has no SIGKILL")
def test_a_killed_worker_is_one_clear_error(run: Sequence[SeriesFrame]) -> None:
    with pytest.raises(DataError, match="killed by SIGKILL") as error:
        list(texts_from_workers([(run[0].path,)], KillItself(), 1))
    assert str(run[0].path) in str(error.value)


def test_what_is_kept_needs_no_frame(run: Sequence[SeriesFrame]) -> None:
    first = reduce_frames(run, MeanLevel())
    pairs = reduce_groups([run[:2], run[2:]], MeanLevel())
    for frame in run:
        frame.path.unlink()
    assert reduce_frames(run, MeanLevel()) == first
    assert reduce_frames(run[::-1], MeanLevel()) == first[::-1]
    assert reduce_groups([run[:2], run[2:]], MeanLevel()) == pairs


def test_another_argument_or_frame_is_not_what_was_kept(run: Sequence[SeriesFrame]) -> None:
    first = reduce_frames(run[:1], MeanLevel())
    assert reduce_frames(run[:1], MeanLevel(2.0)) == [first[0] + 2.0]
    run[0].path.unlink()
    with pytest.raises(UsageError):
        reduce_frames(run[:1], MeanLevel(1.0))
    with pytest.raises(UsageError):
        reduce_frames([replace(run[0], sha256="0" * 64)], MeanLevel())


def test_what_one_failed_frame_leaves_is_kept(run: Sequence[SeriesFrame]) -> None:
    last = run[-1].path.read_bytes()
    run[-1].path.write_bytes(b"")
    with pytest.raises(FrameError):
        reduce_frames(run, MeanLevel())
    run[-1].path.write_bytes(last)
    for frame in run[:-1]:
        frame.path.unlink()
    assert len(reduce_frames(run, MeanLevel())) == len(run)


def forged(intact: bytes) -> bytes:
    """The file with its last value replaced by none, under a digest that fits."""
    head, _, content = intact.decode().partition("\n")
    *others, last = content.splitlines(keepends=True)
    content = "".join([*others, f"{last.split(' ')[0]}\n"])
    return f"{head.rpartition(' ')[0]} {own_digest(content.encode())}\n{content}".encode()


@pytest.mark.parametrize("damage", ["cut off", "one byte", "no text", "empty", "forged"])
def test_a_damaged_file_is_made_again(run: Sequence[SeriesFrame], damage: str) -> None:
    first = reduce_frames(run, MeanLevel())
    (file,) = kept_files(run)
    intact = file.read_bytes()
    middle = len(intact) // 2
    file.write_bytes(
        {
            "cut off": intact[:middle],
            "one byte": intact[:-3] + bytes([intact[-3] ^ 1]) + intact[-2:],
            "no text": b"\xff" * 100,
            "empty": b"",
            "forged": forged(intact),
        }[damage]
    )
    assert reduce_frames(run, MeanLevel()) == first
    assert file.read_bytes() == intact


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.binary(max_size=80) | st.text(max_size=40).map(str.encode),
    key=st.sampled_from(["of a frame", "none"]),
    digest=st.sampled_from([own_digest, lambda content: sha256(content).hexdigest()]),
)
def test_no_malformed_file_is_a_fault_and_none_of_anybody_counts(
    run: Sequence[SeriesFrame], content: bytes, key: str, digest: Callable[[bytes], str]
) -> None:
    first = reduce_frames(run, MeanLevel())
    (file,) = kept_files(run)
    identity = file.read_bytes().partition(b"\n")[0].rpartition(b" ")[0]
    name = run[0].sha256.encode() if key == "of a frame" else b"x"
    lines = name + b" " + content + b"\n"
    file.write_bytes(identity + b" " + digest(lines).encode() + b"\n" + lines)
    again = reduce_frames(run, MeanLevel())
    assert again == first or digest is own_digest
    file.write_bytes(content)
    assert reduce_frames(run, MeanLevel()) == first


def test_what_other_code_kept_is_deleted(run: Sequence[SeriesFrame]) -> None:
    reduce_frames(run, MeanLevel())
    (file,) = kept_files(run)
    older = file.with_name(f"{file.name[: -len('0.jsonl')]}x.jsonl")
    older.write_bytes(file.read_bytes())
    other = file.with_name("OtherReduction-0-0.jsonl")
    other.write_bytes(b"")
    reduce_frames(run, MeanLevel(2.0))
    assert older not in kept_files(run)
    assert {file, other} < {*kept_files(run)}


def test_nothing_is_kept_of_frames_without_checksum_or_run(
    run: Sequence[SeriesFrame], tmp_path: Path
) -> None:
    reduce_frames([replace(frame, sha256="") for frame in run], MeanLevel())
    loose = tmp_path / "loose.dng"
    loose.write_bytes(run[0].path.read_bytes())
    reduce_frames([replace(run[0], path=loose)], MeanLevel())
    assert kept_files(run) == []
    assert not (tmp_path / "cache").exists()


def test_a_folder_that_takes_nothing_does_no_harm(run: Sequence[SeriesFrame]) -> None:
    (run[0].path.parents[1] / "cache").write_text("in the way of the folder")
    assert reduce_frames(run, MeanLevel()) == reduce_frames(run, MeanLevel())
