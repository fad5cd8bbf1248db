"""The driver through the real libgphoto2 on the simulated camera, over PTP/IP and in real time."""

import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from labrig.acquire import Camera, Checkable, ExposureSettings, KeptAwake, LiveView
from labrig.drivers.gphoto2_camera import Gphoto2Camera
from labrig.foundation.clock import Interrupted, SystemClock
from labrig.foundation.errors import DeviceError, DeviceLostError
from tests.conftest import Ended

from .bench import JPEG, FastClock, Loopback, connected, photographing
from .conftest import Processes

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="python-gphoto2 is not made for Windows"
)

SHORT = ExposureSettings(1 / 64, 400, 5.6)
RIG = """
name: camera over the network
devices:
  camera:
    driver: gphoto2_camera
    address: {address}
    shutter_lag: 63 ms
    longest_exposure: 0.3 s
"""


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def test_a_session_with_the_simulated_camera() -> None:
    with photographing(shutter_lag="63 ms") as (camera, film):
        for role in (Camera, LiveView, Checkable, KeptAwake):
            assert isinstance(camera, role)
        assert camera.identity().startswith("Canon EOS 5D Mark II, serial 0730100001")
        assert "libgphoto2 2." in camera.identity()
        assert {finding.severity for finding in camera.findings()} == {"fine", "warn"}

        capabilities = camera.capabilities()
        assert len(capabilities.exposures_s) == 55
        assert (capabilities.exposures_s[0], capabilities.exposures_s[-1]) == (1 / 8192, 32.0)
        assert capabilities.isos == (100, 200, 400, 800, 1600)
        assert (capabilities.f_numbers[0], capabilities.f_numbers[-1]) == (1.8, 22.0)

        assert camera.configure(ExposureSettings(1 / 60, 400, 5.6)) == SHORT
        camera.make_safe()
        asked_s = SystemClock().now()
        frames = []
        for settings in (SHORT, SHORT, ExposureSettings(1 / 4, 1600, 4.0)):
            assert camera.configure(settings) == settings
            camera.arm()
            frames.append(camera.shoot())
            assert asked_s + 0.063 < frames[-1].start_s < SystemClock().now()
            assert frames[-1].end_s - frames[-1].start_s == settings.exposure_s
        assert [digest(frame.data) for frame in frames] == [digest(raw) for raw in film.delivered]
        assert [(taken.exposure_s, taken.iso) for taken in film.taken] == [
            (frame.settings.exposure_s, frame.settings.iso) for frame in frames
        ]
        assert {frame.suffix for frame in frames} == {".dng"}

        assert camera.preview().startswith(JPEG[:3])
        camera.keep_awake()
        assert digest(camera.shoot().data) == digest(film.delivered[-1]), "live view ends by itself"
        camera.make_safe()


def test_released_by_trigger_capture() -> None:
    # libgphoto2 may press before the lens is ready; the driver then waits for as long for a frame.
    with photographing(release="trigger", transfer_timeout="1 s") as (camera, film):
        assert "trigger_capture" in camera.identity()
        camera.configure(SHORT)
        assert digest(camera.shoot().data) == digest(film.delivered[0])
        camera.make_safe()


def test_what_it_does_not_offer() -> None:
    with photographing() as (camera, film):
        for wanted, why in (
            (ExposureSettings(45.0, 400, 5.6), "does not offer this shutter time"),
            (ExposureSettings(1.0, 123, 5.6), "does not offer this ISO"),
            (ExposureSettings(1.0, 400, 1.2), "its lens offers f/1.8"),
        ):
            with pytest.raises(DeviceError, match=why):
                camera.configure(wanted)
        assert not film.taken


@pytest.mark.parametrize("ready_s", [0.0, 0.1], ids=["not ready", "exposing"])
def test_a_frame_that_was_broken_off_is_never_taken_for_the_next(ready_s: float) -> None:
    clock = SystemClock()
    with photographing(clock) as (camera, film):
        camera.configure(ExposureSettings(0.25, 100, 8.0))
        camera.arm()
        clock.sleep(ready_s)
        clock.interrupt(signal.SIGINT)
        with pytest.raises(Interrupted):
            camera.shoot()
        camera.make_safe()
        camera.configure(SHORT)
        frame = camera.shoot()
        # Whether the camera was ready in time depends on the load of the PC.
        *broken_off, last = [taken.exposure_s for taken in film.taken]
        assert last == 1 / 64
        assert broken_off in ([], [0.25])
        assert digest(frame.data) == digest(film.delivered[-1])


def test_when_libgphoto2_hangs_ctrl_c_is_heard_and_the_camera_is_had_again(
    helpers: Processes,
) -> None:
    clock = FastClock()
    with photographing(clock) as (camera, _):
        (hanging,) = helpers
        assert os.getpgid(hanging.pid) != os.getpgid(0), "Ctrl-C at a terminal is for the group"
        hanging.send_signal(signal.SIGSTOP)
        clock.interrupt(signal.SIGINT)
        with pytest.raises(Interrupted):
            camera.findings()
        camera.make_safe()
        assert hanging.returncode == -signal.SIGKILL
        assert camera.configure(SHORT) == SHORT


def test_libgphoto2_that_does_not_answer_is_ended(helpers: Processes) -> None:
    with photographing(FastClock()) as (camera, _):
        helpers[0].send_signal(signal.SIGSTOP)
        with pytest.raises(DeviceLostError, match="no answer from libgphoto2 within 25 s"):
            camera.capabilities()


def test_libgphoto2_that_crashes_is_lost_for_now(helpers: Processes) -> None:
    with photographing() as (camera, film):
        camera.configure(SHORT)
        helpers[0].kill()
        with pytest.raises(DeviceLostError, match=r"libgphoto2 ended by itself \(exit code -9\)"):
            camera.shoot()
        camera.make_safe()
        camera.configure(SHORT)
        assert digest(camera.shoot().data) == digest(film.delivered[-1])


@contextmanager
def serving(rig: Path) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    """`labrig sim camera` in a process of its own, and its address."""
    command = [sys.executable, "-m", "labrig", "sim", "camera", "--port", "0", "--rig", str(rig)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            yield server.stdout.readline().strip(), server
        finally:
            server.kill()


@pytest.mark.campaign
def test_rig_check_then_the_camera_is_switched_off(
    labrig: Callable[..., Ended], make_rig: Callable[..., Path], tmp_path: Path
) -> None:
    rig = tmp_path / "network.yaml"
    with serving(make_rig()) as (address, server):
        rig.write_text(RIG.format(address=address))
        ended = labrig("rig", "check", rig, "--json")
        assert (ended.code, ended.err) == (0, "")
        (camera,) = json.loads(ended.out)["devices"]
        assert "5D Mark II" in camera["identity"]
        assert "with the lamp off a frame is dark" in {f["what"] for f in camera["findings"]}
        assert sum("dark frame" in measured["what"] for measured in camera["measured"]) == 3
        with connected(address) as lost:
            lost.configure(SHORT)
            server.kill()
            server.wait()
            with pytest.raises(DeviceLostError, match="I/O problem") as complaint:
                lost.shoot()
            assert len(str(complaint.value).splitlines()) == 1
            with pytest.raises(DeviceLostError, match="camera not known to be safe"):
                lost.make_safe()
    ended = labrig("rig", "check", rig)
    assert ended.code == 3
    assert "nobody answers" in ended.err


def test_a_camera_that_leaves_after_it_was_dialled() -> None:
    with ExitStack() as hung_up, socket.create_server(("127.0.0.1", 0)) as leaving:

        class Dialled(Loopback):
            def tcp(self, address: str, default_port: int) -> socket.socket:
                dialled = super().tcp(address, default_port)
                hung_up.enter_context(leaving.accept()[0])
                leaving.close()
                return dialled

        address = f"ptpip://127.0.0.1:{leaving.getsockname()[1]}"
        with pytest.raises(DeviceError, match=f"camera {address}: connecting: libgphoto2 says"):
            Gphoto2Camera(address, Gphoto2Camera.Settings(), Dialled())
