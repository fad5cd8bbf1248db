"""The trial frame that tells how large a real camera's frames are, before anything warms up."""

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from labrig.acquire import read_protocol, read_rig_file
from labrig.bench import Bench, open_bench
from labrig.errors import ProtocolError
from labrig.record import read_run
from labrig.trial_frame import check_regions
from labrig.yaml_file import read_yaml
from tests.conftest import Ended

Make = Callable[..., Path]


@pytest.mark.parametrize(
    ("patch", "frame_pixels", "said"),
    [
        ([32, 20, 30, 24], None, None),
        ([32, 20, 30, 24], [96, 64], None),
        ([32, 20, 80, 24], None, "patches.a: region"),
        ([32, 20, 30, 24], [5634, 3752], "frame_pixels: [96, 64]"),
    ],
)
def test_regions_are_held_against_what_the_camera_delivers(
    make_rig: Make,
    make_protocol: Make,
    patch: list[int],
    frame_pixels: list[int] | None,
    said: str | None,
) -> None:
    path = make_rig()
    content = yaml.safe_load(path.read_text())
    content["devices"]["camera"] |= {"frame_pixels": frame_pixels}
    path.write_text(yaml.safe_dump(content))
    protocol = read_protocol(make_protocol(patches={"a": patch}))
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as rig:
        if said is None:
            check_regions(protocol, rig, trust_offers=False)
        else:
            with pytest.raises(ProtocolError) as caught:
                check_regions(protocol, rig, trust_offers=False)
            assert said in str(caught.value)
        assert bench.clock.now() < 10.0


def test_a_run_ends_at_once_and_goes_on_when_the_region_is_corrected(
    labrig: Callable[..., Ended],
    make_rig: Make,
    make_protocol: Make,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As on a real bench, whose rig file does not tell the size of a frame."""
    monkeypatch.setattr(Bench, "is_simulated", property(lambda bench: False))
    rig = make_rig(faults=[{"relays_unplugged": {"at": "30 s"}}])
    assert labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs").code == 3
    (folder,) = (tmp_path / "runs").iterdir()
    rig_content = read_yaml(folder / "rig.yaml")
    rig_content["simulation"]["faults"] = []
    del rig_content["devices"]["camera"]["frame_pixels"]
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig_content))
    protocol = read_yaml(folder / "protocol.yaml")
    for patch, code in (([32, 20, 80, 24], 2), ([32, 20, 30, 24], 0)):
        protocol["patches"] = {"a": patch}
        (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol))
        attempts = len(read_run(folder).attempts)
        ended = labrig("resume", folder, "--no-process")
        assert ended.code == code, ended.err
        if code:
            assert "patches.a" in ended.err
            assert str(folder / "protocol.yaml") in ended.err
            assert len(read_run(folder).attempts) == attempts, "nothing was begun"
