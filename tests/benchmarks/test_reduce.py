"""A 21-megapixel frame to means ± σ of a patch, against rawpy's own decoding of the same bytes."""

import io
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import rawpy

from labrig.record import FrameRecord, damaged_frames
from labrig.reduce import SeriesFrame, measure, read_raw, reduce_patches
from labrig.sim.dng import Shot, encode_dng
from tests.benchmarks.lossless_jpeg import encode_compressed_dng

Against = Callable[..., None]
Mosaic = npt.NDArray[np.uint16]

HEIGHT, WIDTH = 3744, 5616
REGIONS = {
    "a tenth by a tenth": (0.45, 0.45, 0.1, 0.1),
    "half by half": (0.25, 0.25, 0.5, 0.5),
    "whole frame": (0.0, 0.0, 1.0, 1.0),
}
SHOT = Shot(1.7e9, 1.0, 400, 4.0)
FRAMES = 14
#: Frames of a run that is processed again; nothing depends on their size.
MANY = 500


@pytest.fixture(scope="module")
def mosaic() -> Mosaic:
    """A glow in the middle, with photon and read noise."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    glow = 2000 * np.exp(-(((x - WIDTH / 2) / 1200) ** 2) - ((y - HEIGHT / 2) / 900) ** 2)
    light = glow * np.tile([[0.3, 1.0], [1.0, 0.6]], (HEIGHT // 2, WIDTH // 2))
    level = 1024 + light + rng.normal(0, 1, light.shape) * np.sqrt(36 + 2 * light)
    return np.asarray(np.clip(np.rint(level), 0, 15760), dtype=np.uint16)


@pytest.fixture(scope="module", params=["lossless JPEG", "uncompressed"])
def dng(request: pytest.FixtureRequest, mosaic: Mosaic) -> tuple[str, bytes]:
    """Its kind and its bytes; cameras compress."""
    encode: Callable[[Mosaic, Shot], bytes] = (
        encode_dng if request.param == "uncompressed" else encode_compressed_dng
    )
    content = encode(mosaic, SHOT)
    assert np.array_equal(read_raw(content).mosaic, mosaic)
    return request.param, content


def decoded(content: bytes) -> Any:
    with rawpy.imread(io.BytesIO(content)) as raw:
        return raw.raw_image[0, 0]


@pytest.mark.parametrize("region", REGIONS)
def test_one_frame(region: str, dng: tuple[str, bytes], against: Against) -> None:
    kind, content = dng
    against(
        lambda: measure(read_raw(content), REGIONS[region]),
        {"rawpy decodes": lambda: decoded(content)},
        rounds=7,
        what=f"21 MP {kind}, {region}",
    )


def test_a_run(dng: tuple[str, bytes], against: Against, tmp_path: Path) -> None:
    """From files, with dark frames and their hot pixels, in workers: what `labrig process` does."""
    kind, content = dng
    paths = []
    for number in range(FRAMES):
        paths.append(tmp_path / f"{number:06d}.dng")
        paths[-1].write_bytes(content)
    frames = [SeriesFrame(path, 5.0 * n, 1.0) for n, path in enumerate(paths[:-2])]
    darks = [SeriesFrame(path, 0.0, 1.0) for path in paths[-2:]]

    def peer() -> None:
        for path in paths:
            with rawpy.imread(str(path)) as raw:
                assert raw.raw_image[0, 0] > 0

    against(
        lambda: reduce_patches(frames, {"sample": REGIONS["half by half"]}, darks),
        {"rawpy decodes in one process": peer},
        rounds=3,
        what=f"21 MP {kind}, half by half, {FRAMES - 2} frames, 2 darks",
        each=FRAMES,
    )


def test_a_run_again(mosaic: Mosaic, against: Against, tmp_path: Path) -> None:
    """A run is fitted again: checksums are trusted, numbers are kept."""
    (tmp_path / "frames").mkdir()
    records = []
    for number in range(MANY):
        path = tmp_path / "frames" / f"{number:06d}.dng"
        content = encode_dng(mosaic[:416, :624], SHOT) + b"%06d" % number
        path.write_bytes(content)
        records.append(
            FrameRecord(
                path, sha256(content).hexdigest(), len(content), "decay-1", "decay", 1.0, 400, 4.0,
                5.0 * number, 5.0 * number + 1, 0.0,
            )
        )  # fmt: skip
    frames = [
        SeriesFrame(record.path, record.start_time, 1.0, sha256=record.sha256) for record in records
    ]

    def again() -> None:
        assert not damaged_frames(tmp_path, records)
        reduce_patches(frames, {"sample": REGIONS["half by half"]})

    against(
        again,
        {"stat of each file": lambda: [record.path.stat() for record in records]},
        rounds=5,
        what=f"reducing {MANY} frames again",
        each=MANY,
    )
