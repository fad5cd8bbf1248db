"""Devices that are pulled out in the middle of a run and put back: the unit is done again."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import PlanClock, RunObserver
from labrig.bench import Recording
from labrig.foundation.clock import Clock, Interrupted
from labrig.foundation.errors import DeviceError
from labrig.record import read_run
from labrig.sim.camera.usb.backend import CameraBackend
from tests.acquire.fakes import Watching
from tests.conftest import Ended
from tests.run_folders import lamp_after, make_folder

Make = Callable[..., Path]
Labrig = Callable[..., Ended]

CAMPAIGN = pytest.mark.campaign
KINDS = {1: "command", 2: "data", 3: "response", 4: "event"}
CAMERA_BACK = "20 s"


@pytest.fixture
def quick(make_protocol: Make) -> Path:
    return make_protocol(charge="60 s", **{"for": "20 s"})


def transfers(rig: Path, protocol: Path, folder: Path, patch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Where on the bulk pipes, in bytes since the beginning, each kind of transfer took place."""
    backend = CameraBackend
    places: dict[str, list[int]] = {}
    carried = 0

    def counted(name: str, transfer: Callable[..., int]) -> Callable[..., int]:
        def count(self: Any, dev: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
            nonlocal carried
            size = transfer(self, dev, ep, intf, data, timeout)
            kind = KINDS.get(int.from_bytes(bytes(data[4:6]), "little"), "middle of data")
            places.setdefault(f"{kind} {name}", []).append(carried + size // 2)
            carried += size
            return size

        return count

    for method, name in (("bulk_write", "out"), ("bulk_read", "in")):
        patch.setattr(backend, method, counted(name, getattr(backend, method)))
    Recording.prepare(protocol, rig, folder).record(quietly)
    patch.undo()
    return places


@contextmanager
def quietly(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
    yield Watching()


@pytest.mark.parametrize("fraction", [pytest.param(0.3, marks=CAMPAIGN), 0.97])
def test_unplugged_at_each_phase_of_a_transfer_the_decay_completes(
    quick: Path,
    make_rig: Make,
    tmp_path: Path,
    labrig: Labrig,
    monkeypatch: pytest.MonkeyPatch,
    fraction: float,
) -> None:
    phases = transfers(make_rig(), quick, tmp_path / "undisturbed", monkeypatch)
    assert {"command out", "data in", "middle of data in", "response in"} <= set(phases)
    for kind, places in phases.items():
        fault = {"after_bytes": places[int(fraction * len(places))], "for": CAMERA_BACK}
        rig = make_rig(faults=[{"camera_unplugged": fault}])
        ended = labrig("run", quick, "--rig", rig, "--runs", tmp_path / kind, "--no-process")
        assert ended.code == 0, (kind, ended.err)
        assert "waiting up to 5 min" in ended.err, kind
        record = read_run(ended.run_folder)
        assert list(record.completed()) == ["dark", "decay-1"]
        assert len(record.frames("decay")) == 4
        assert [attempt.exit_status for attempt in record.attempts].count("fail") <= 1


@pytest.mark.parametrize("device", ["camera", "relays"])
@pytest.mark.parametrize(
    "moment",
    [
        pytest.param("30 s", marks=CAMPAIGN),
        "1215 s",
        pytest.param("2100 s", marks=CAMPAIGN),
        "2118 s",
    ],
)
def test_unplugged_at_any_time_the_run_completes_and_the_lamp_is_off(
    quick: Path, make_rig: Make, tmp_path: Path, device: str, moment: str
) -> None:
    folder = make_folder(quick, tmp_path)
    rig = make_rig(faults=[{f"{device}_unplugged": {"at": moment, "for": "40 s"}}])
    assert not lamp_after(folder, rig, lambda: None)
    record = read_run(folder)
    assert list(record.completed()) == ["dark", "decay-1"]
    assert [attempt.exit_status for attempt in record.attempts].count("fail") <= 1


def test_what_does_not_come_back_ends_the_run_with_one_line_and_can_be_resumed(
    quick: Path, make_rig: Make, tmp_path: Path, labrig: Labrig
) -> None:
    rig = make_rig(faults=[{"camera_unplugged": {"at": "25 min", "for": "10 min"}}])
    ended = labrig("run", quick, "--rig", rig, "--runs", tmp_path / "runs", "--no-process")
    assert ended.code == 3
    complaint = ended.err.splitlines()[-1]
    assert complaint.startswith("labrig: ")
    assert "gone" in complaint
    (folder,) = (tmp_path / "runs").iterdir()
    assert f"labrig resume {folder}" in complaint
    resumed = labrig("resume", folder, "--no-process")
    assert resumed.code == 3  # the room opens where the journal ends: it is still away
    assert "no device" in resumed.err


def test_a_loose_contact_is_not_waited_for_for_ever(
    quick: Path, make_rig: Make, tmp_path: Path, labrig: Labrig
) -> None:
    shaking = [
        {"relays_unplugged": {"at": f"{minute} min", "for": "1 s"}} for minute in range(5, 300, 4)
    ]
    rig = make_rig(faults=shaking)
    ended = labrig("run", quick, "--rig", rig, "--runs", tmp_path / "runs", "--no-process")
    assert ended.code == 3
    assert ended.err.count("waiting up to 5 min") == 2
    assert "Numato" in ended.err.splitlines()[-1]


def test_ctrl_c_while_waiting_for_a_device_ends_the_wait(
    quick: Path, make_rig: Make, tmp_path: Path
) -> None:
    class Impatient(Watching):
        def warn(self, text: str) -> None:
            super().warn(text)
            os.kill(os.getpid(), signal.SIGINT)

    @contextmanager
    def impatiently(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
        yield Impatient()

    rig = make_rig(faults=[{"camera_unplugged": {"at": "25 min"}}])
    with pytest.raises(Interrupted) as caught:
        Recording.prepare(quick, rig, tmp_path).record(impatiently)
    assert "labrig resume" in str(caught.value)


def test_frames_that_are_not_as_the_journal_says_are_named_at_resume(
    labrig: Labrig, make_rig: Make, quick: Path, tmp_path: Path
) -> None:
    run = labrig("run", quick, "--rig", make_rig(), "--runs", tmp_path, "--no-process").run_folder
    assert "warning" not in labrig("resume", run, "--no-process").err
    frames = run / "frames"
    (frames / "000099.dng").write_bytes(b"its line never came")
    (frames / "000100.dng.part").write_bytes(b"half")
    (frames / "000001.dng").unlink()
    (frames / "000002.dng").write_bytes((frames / "000003.dng").read_bytes())
    ended = labrig("resume", run, "--no-process")
    assert ended.code == 0
    unknown, damaged = [line for line in ended.err.splitlines() if "warning: " in line]
    assert "000099.dng, 000100.dng.part" in unknown
    assert "000001.dng is missing, 000002.dng was changed" in damaged
    assert (frames / "000099.dng").exists()


def test_a_device_that_is_missing_at_the_start_is_not_waited_for(
    quick: Path, make_rig: Make, tmp_path: Path
) -> None:
    rig = make_rig(faults=[{"camera_unplugged": {"for": "10 s"}}])
    with pytest.raises(DeviceError, match="no device"):
        Recording.prepare(quick, rig, tmp_path).record(quietly)
    assert list(tmp_path.glob("2026*")) == []
