"""A decay as a TIFF stack: linear values as labrig's own reduction has them, times in labels."""

from pathlib import Path

import numpy as np
import pytest
import tifffile

from labrig.analyse import Overrides, intact_frames
from labrig.export import write_image_stack
from labrig.foundation.errors import UsageError
from labrig.record import read_run
from labrig.reduce import WHOLE_FRAME, reduce_series
from tests.analyse.recorded import record

DECAY = {"protocol": "decay", "sample": {"name": "test"}, "charge": "60 s", "for": "20 s",
         "first": "1 s", "exposure": "1 s"}  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("stack"), DECAY)


def test_its_means_are_those_of_the_series(run: Path, tmp_path: Path) -> None:
    frames = intact_frames(read_run(run), Overrides())
    shape = write_image_stack(tmp_path / "decay.tif", frames.decay, frames.dark)
    stack = tifffile.imread(tmp_path / "decay.tif")
    assert stack.shape == shape
    assert stack.dtype == np.float32
    series = reduce_series(frames.decay, WHOLE_FRAME, frames.dark)
    np.testing.assert_allclose(stack.mean(axis=(2, 3)), series.values, rtol=2e-3, atol=0.05)
    with tifffile.TiffFile(tmp_path / "decay.tif") as file:
        about = file.imagej_metadata
        assert file.series[0].axes == "TCYX"
    assert about is not None
    times_s = [float(label.split("t=")[1].split()[0]) for label in about["Labels"][:: shape[1]]]
    np.testing.assert_allclose(times_s, [frame.t_s for frame in frames.decay], atol=1e-4)


def test_a_smaller_one_keeps_the_mean_light(run: Path, tmp_path: Path) -> None:
    frames = intact_frames(read_run(run), Overrides())
    whole, small = tmp_path / "whole.tif", tmp_path / "small.tif"
    write_image_stack(whole, frames.decay[:2], frames.dark)
    columns = write_image_stack(small, frames.decay[:2], frames.dark, width=12)[3]
    assert columns == 12
    means = [tifffile.imread(path).mean(axis=(2, 3)) for path in (whole, small)]
    np.testing.assert_allclose(means[1], means[0], rtol=1e-4)


def test_no_frames_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected frames of a decay, got none"):
        write_image_stack(tmp_path / "decay.tif", [], [])
