"""Frames and journal lines on the disk, against writing the same bytes and waiting for them."""

import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from labrig.record import RunFolder

Against = Callable[..., None]

FRAME_BYTES = 25_000_000


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[RunFolder]:
    texts = {"protocol.yaml": "", "rig.yaml": ""}
    with RunFolder.create(tmp_path, "benchmark", 1_767_225_600.0, texts, seed=None) as made:
        yield made


def synced(path: Path, data: bytes) -> None:
    with path.open("wb", buffering=0) as file:
        file.write(data)
        os.fsync(file.fileno())


def test_frames_kept(folder: RunFolder, tmp_path: Path, against: Against) -> None:
    data = np.random.default_rng(2).bytes(FRAME_BYTES)
    attempt = folder.attempt("decay-1", lambda: 1_767_225_600.0, {})

    def keep() -> None:
        record = attempt.frame(
            data,
            ".cr2",
            role="decay",
            exposure_s=1.0,
            iso=400,
            f_number=4.0,
            start_time=1_767_225_600.0,
            end_time=1_767_225_601.0,
            late_s=0.0,
        )
        record.path.unlink()

    def write() -> None:
        path = tmp_path / "raw"
        synced(path, data)
        path.unlink()

    against(
        keep,
        {
            "write and fsync of the same bytes": write,
            "SHA-256 of the same bytes": lambda: hashlib.sha256(data).digest(),
        },
        rounds=15,
        what="25 MB frame and its journal line, durable",
    )


def test_journal_lines(folder: RunFolder, tmp_path: Path, against: Against) -> None:
    from labrig.record import ActionRecord

    attempt = folder.attempt("decay-1", lambda: 1_767_225_600.0, {})
    action = ActionRecord("decay-1", "lamp", "on", 1_767_225_600.0, 1_767_225_600.1, 0.0)
    line = b"x" * 600
    other = (tmp_path / "lines").open("ab", buffering=0)

    def append() -> None:
        other.write(line)
        os.fsync(other.fileno())

    with other:
        against(
            lambda: attempt.action(action),
            {"write and fsync of as many bytes": append},
            rounds=50,
            what="journal line, durable",
        )
