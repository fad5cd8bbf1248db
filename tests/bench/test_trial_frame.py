"""The trial frame that tells how large a real camera's frames are, before anything warms up."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.acquire import CAMERA, read_rig_file
from labrig.bench import open_bench
from labrig.bench.execution import offers_with_frame_size
from labrig.foundation.errors import ProtocolError
from labrig.foundation.yaml_file import read_yaml
from labrig.record import read_run
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Make = Callable[..., Path]


def test_a_trial_frame_shows_the_size_of_frames(make_rig: Make) -> None:
    path = make_rig()
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as rig:
        assert offers_with_frame_size(rig[CAMERA]).frame_pixels == (96, 64)
        assert bench.clock.now() < 10.0


def test_a_rig_file_of_another_camera_is_refused(make_rig: Make) -> None:
    path = make_rig()
    content = read_quickly(path.read_text())
    content["devices"]["camera"] |= {"frame_pixels": [5634, 3752]}
    path.write_text(write_quickly(content))
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        bench.devices() as rig,
        pytest.raises(ProtocolError, match=re.escape("write frame_pixels: [96, 64]")),
    ):
        offers_with_frame_size(rig[CAMERA])


def test_a_run_ends_at_once_and_goes_on_when_the_region_is_corrected(
    labrig: Callable[..., Ended],
    make_rig: Make,
    make_protocol: Make,
    tmp_path: Path,
) -> None:
    """Make a bench as a real one, whose rig file does not tell the size of a frame."""
    rig = make_rig(faults=[{"relays_unplugged": {"at": "30 s"}}])
    assert labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs").code == 3
    (folder,) = (tmp_path / "runs").iterdir()
    rig_content = read_yaml(folder / "rig.yaml")
    rig_content["simulation"]["faults"] = []
    del rig_content["devices"]["camera"]["frame_pixels"]
    (folder / "rig.yaml").write_text(write_quickly(rig_content))
    protocol = read_yaml(folder / "protocol.yaml")
    for patch, code in (([32, 20, 80, 24], 2), ([32, 20, 30, 24], 0)):
        protocol["patches"] = {"a": patch}
        (folder / "protocol.yaml").write_text(write_quickly(protocol))
        attempts = len(read_run(folder).attempts)
        ended = labrig("resume", folder, "--no-process", "--edited")
        assert ended.code == code, ended.err
        if code:
            assert "patches.a" in ended.err
            assert str(folder / "protocol.yaml") in ended.err
            assert len(read_run(folder).attempts) == attempts, "nothing was begun"
