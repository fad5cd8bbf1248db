"""Our driver photographs with libgphoto2's own virtual camera, made by other people."""

import hashlib
import json
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="libgphoto2's vusb is made for Linux only"
)

ROOT = Path(__file__).parents[2]
MAX_S = 60.0
#: Larger than one read, and a whole number of packets with its header.
PICTURE_BYTES = 512 * 300 - 12


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """What the virtual camera takes for every photograph."""
    path = tmp_path / "GP_0001.JPG"
    path.write_bytes(b"\xff\xd8" + random.Random(1).randbytes(PICTURE_BYTES - 2))
    return path


def drive(as_what: str, card: Path) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "tests.counterparts.vusb_host", as_what, str(card)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=MAX_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_step_by_step_it_is_set_released_and_delivers_its_picture(picture: Path) -> None:
    found = drive("session", picture.parent)
    assert {10000, 500, 100, 1} <= set(found["choices"])
    assert found["set"] == [500, 500], "50 ms, read back and asked again"
    # the camera makes a folder first
    assert found["events"] == [0x4002, 0x4002, 0x400D]
    (taken,) = found["pictures"]
    assert taken["sha256"] == hashlib.sha256(picture.read_bytes()).hexdigest()
    assert taken["name"].startswith("GPH_")
    assert not taken["is_raw"]


def test_as_a_rigs_camera_it_is_known_set_and_refused_for_its_jpegs(picture: Path) -> None:
    found = drive("camera", picture.parent)
    assert found["identity"].startswith("GP VC, serial")
    assert found["exposures_s"] == [0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 1.0]
    assert found["f_numbers"][0] == 2.8
    assert found["in_force"] == "1/50 s ISO 100 f/2.8"
    said = dict(found["findings"])
    assert "no RAW format (it lists 0x3801)" in said["refuse"]
    for refused in found["refused"]:
        assert refused.startswith("expected a RAW file from the camera, it took 'GPH_")
        assert "\n" not in refused


@pytest.mark.campaign
def test_its_card_fills_up(picture: Path) -> None:
    *others, reported, refused = drive("until-full", picture.parent)["said"]
    assert len(others) > 10
    assert "StoreFull 0x400A" in reported
    assert "0x200C StoreFull" in refused
