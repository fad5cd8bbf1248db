"""Journals against RAW files: settings and times that somebody edited, and sealed again."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import labrig
from labrig.analyse import (
    Overrides,
    clock_warnings,
    require_recorded_settings,
    settings_differences,
)
from labrig.cli import guarded
from labrig.drivers.gphoto2_camera import Gphoto2Camera
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.errors import DataError
from labrig.record import RunRecord
from labrig.reduce import read_exif
from labrig.sim.dng import Shot, encode_dng
from tests.conftest import write_short_decay, write_small_rig
from tests.resealed import reseal

EOS = "Canon EOS 5D Mark II, serial 1"
#: Label on a dial, and the actual time behind it, in seconds.
DIAL = {1 / 60: 1 / 64, 30.0: 32.0, 1 / 125: 1 / 128, 0.3: 2 ** (-5 / 3), 1.0: 1.0, 15.0: 16.0}


def recorded(place: Path, body: str, **protocol: object) -> Path:
    place.mkdir()
    rig = write_small_rig(place / "rig.yaml", camera={"body": body})
    at_bulb = "driver: ptp_camera\n    longest_exposure: 64 s\n"
    rig.write_text(rig.read_text().replace("driver: ptp_camera\n", at_bulb))
    keys = {"for": "30 s", "exposure": "1 s"} | protocol
    write_short_decay(place / "protocol.yaml", **keys)
    asked = [str(place / "protocol.yaml"), "--rig", str(place / "rig.yaml"), "--no-process"]
    assert guarded(["run", *asked, "--runs", str(place / "runs")]) == 0
    (run,) = (place / "runs").iterdir()
    return run


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a Canon, whose 1/3 s is 0.315 s."""
    return recorded(tmp_path_factory.mktemp("kept") / "run", "eos", exposure="0.315 s")


def edited(
    kept: Path, place: Path, change: Callable[[dict[str, Any]], None], role: str = "decay"
) -> RunRecord:
    """A copy of a run with edited events of a role, chained anew."""
    run = Path(shutil.copytree(kept, place / "edited"))
    journal, lines = run / "journal.jsonl", []
    for line in (run / "journal.jsonl").read_text().splitlines():
        entry = json.loads(line)
        if entry["doc"].get("data", {}).get("role") == role:
            change(entry["doc"]["data"])
            # Nothing is written before it has ended.
            written_s = max(entry["doc"]["time"], entry["doc"]["data"]["end_time"])
            entry["doc"] |= {
                "time": written_s,
                "timestamps": dict.fromkeys(entry["doc"]["data"], written_s),
            }
        lines.append(json.dumps(entry))
    journal.write_text("".join(f"{line}\n" for line in lines))
    reseal(journal)
    return labrig.read_run(run)


def rig_of(run: RunRecord) -> Any:
    return labrig.read_rig_file(run.folder / "rig.yaml")


@pytest.mark.parametrize(
    ("body", "keys"),
    [
        ("eos", {"exposure": "0.315 s"}),
        ("eos", {"exposure": "64 s", "every": "70 s", "for": "5 min"}),
        ("standard", {"exposure": "1/60 s"}),
        ("standard", {"exposure": "0.8 s"}),
    ],
    ids=["dial", "bulb", "standard", "standard, labelled"],
)
def test_a_clean_run_agrees(tmp_path: Path, body: str, keys: dict[str, object]) -> None:
    run = labrig.read_run(recorded(tmp_path / "run", body, **keys))
    assert settings_differences(run, rig_of(run), run.frames("decay")) == {}
    assert clock_warnings(run) == ()
    require_recorded_settings(run, rig_of(run), Overrides())


def lengthen(data: dict[str, Any]) -> None:
    data["exposure_s"] *= 1.03
    data["end_time"] = data["start_time"] + data["exposure_s"]


def nominal(data: dict[str, Any]) -> None:
    data["exposure_s"] = 0.3
    data["end_time"] = data["start_time"] + 0.3


@pytest.mark.parametrize(
    "change",
    [
        lengthen,
        nominal,
        lambda data: data.update(exposure_s=data["exposure_s"] * 1.03),
        lambda data: data.update(iso=2 * data["iso"]),
        lambda data: data.update(f_number=1.01 * data["f_number"]),
        lambda data: data.update(end_time=data["end_time"] + 0.01),
    ],
    ids=["exposure and end", "label of the dial", "exposure", "ISO", "f-number", "end"],
)
def test_settings_that_were_edited_are_refused(
    kept: Path, tmp_path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    run = edited(kept, tmp_path, change)
    frames = run.frames("decay")
    assert set(settings_differences(run, rig_of(run), frames)) == set(frames)
    with pytest.raises(DataError, match=frames[0].path.name):
        require_recorded_settings(run, rig_of(run), Overrides())


def test_a_frame_that_is_left_out_is_not_asked(kept: Path, tmp_path: Path) -> None:
    run = edited(kept, tmp_path, lengthen)
    names = frozenset(frame.path.name for frame in run.frames("decay"))
    require_recorded_settings(run, rig_of(run), Overrides(excluded=names))


@pytest.mark.parametrize("shift_s", [0.7, -0.7])
def test_frames_that_were_moved_in_time_are_named(
    kept: Path, tmp_path: Path, shift_s: float
) -> None:
    def move(data: dict[str, Any]) -> None:
        for key in ("start_time", "end_time"):
            data[key] += shift_s

    run = edited(kept, tmp_path, move)
    (warning,) = clock_warnings(run)
    assert warning.code == "camera-clock-differs"
    assert run.frames("decay")[0].path.name in warning.values["frames"]
    assert warning.values["most_s"] == pytest.approx(0.65, abs=0.1)


@given(st.sampled_from(sorted(DIAL)), st.sampled_from([EOS, "Acme X1, serial 1"]))
def test_the_actual_time_of_a_label_is_that_of_the_dial(label_s: float, identity: str) -> None:
    for times_s in (
        PtpCamera.recorded_exposures_s(label_s, identity),
        Gphoto2Camera.recorded_exposures_s(label_s, identity),
    ):
        assert times_s[0] == pytest.approx(DIAL[label_s], rel=1e-12)
    in_units = [round(1e4 * time_s) for time_s in (label_s, DIAL[label_s])]
    told = [round(1e4 * time_s) for time_s in PtpCamera.recorded_exposures_s(label_s, identity)]
    assert (set(in_units) <= set(told)) == (identity != EOS or label_s == DIAL[label_s])


def test_a_time_beyond_the_dial_is_that_of_the_clock() -> None:
    assert PtpCamera.recorded_exposures_s(64.0, EOS) == ()


def test_the_camera_notes_its_time_in_hundredths() -> None:
    shot = Shot(1_767_225_600.256, 1.0, 100, 2**1.5)
    exif = read_exif(encode_dng(np.zeros((8, 8), dtype=np.uint16), shot))
    assert exif.time_s == pytest.approx(1_767_225_600.25, abs=1e-6)
    assert (exif.time_step_s, exif.f_number) == (0.01, 2.8)
