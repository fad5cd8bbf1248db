"""libgphoto2, which drives thousands of real cameras, takes pictures from the simulated one."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from labrig.foundation.clock import VirtualClock
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation

from .gphoto2_commands import MAX_S, READY, STANDARD_READY, TO_CARD, TO_HOST, command
from .served import EPOCH_S, STANDARD, Film, Taken, served

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="python-gphoto2 is not made for Windows"
)


@pytest.fixture
def home(tmp_path: Path) -> dict[str, str]:
    """Environment in which libgphoto2 finds no settings of anybody's."""
    return os.environ | {"HOME": str(tmp_path), "LANG": "C"}


@contextmanager
def running(arguments: list[str], home: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    """A process that is killed at the end, and at the latest when it has hung for too long."""
    with subprocess.Popen(
        arguments, env=home, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        watchdog = threading.Timer(MAX_S, process.kill)
        watchdog.start()
        try:
            yield process
        finally:
            watchdog.cancel()
            process.kill()


def gphoto2(port: int, home: dict[str, str], *steps: str) -> list[Any]:
    done = subprocess.run(
        command(port, *steps), env=home, capture_output=True, text=True, timeout=MAX_S, check=False
    )
    assert done.returncode == 0, done.stderr
    found: list[Any] = json.loads(done.stdout)
    return found


def test_summary(home: dict[str, str]) -> None:
    with served(Film()) as server:
        (summary,) = gphoto2(server.port, home, "summary")
    for said in ("Canon EOS 5D Mark II", "0730100001", "Canon EOS Capture", "store_00010001"):
        assert said in summary


def test_settings_are_listed_set_and_read_back(home: dict[str, str]) -> None:
    settings = {
        "iso": ("1600", ["100", "400", "6400"]),
        "aperture": ("11", ["1.8", "5.6", "22"]),
        "shutterspeed": ("1/125", ["bulb", "30", "1", "1/8000"]),
    }
    steps = [(f"choices:{name}", f"set:{name}={value}") for name, (value, _) in settings.items()]
    with served(Film()) as server:
        told = gphoto2(server.port, home, *chain.from_iterable(steps))
    for (value, others), choices, read_back in zip(
        settings.values(), told[::2], told[1::2], strict=True
    ):
        assert {value, *others} <= set(choices)
        assert read_back == value


@pytest.mark.parametrize("target", [pytest.param(TO_HOST, marks=pytest.mark.campaign), TO_CARD])
def test_a_picture_of_the_simulated_room_arrives_as_it_was_taken(
    home: dict[str, str], target: str
) -> None:
    clock = VirtualClock(EPOCH_S)
    content = {"sample": "blue-paint", "initial": {"lamp": "on"}}
    simulation = Simulation.model_validate(content | {"sensor": {"width": 96, "height": 64}})
    film = Film(Room(simulation, clock))
    with served(film, clock) as server:
        *_, picture = gphoto2(server.port, home, *READY, target, "capture")
    assert film.taken == [Taken(0.25, 400, 4.0)]
    assert picture["sha256"] == hashlib.sha256(film.delivered[0]).hexdigest()
    assert ("100CANON" in picture["folder"]) is (target is TO_CARD)


@pytest.mark.campaign
def test_a_frame_of_a_large_sensor_arrives_byte_for_byte(home: dict[str, str]) -> None:
    film = Film(size=17_000_001)  # does not fit into three bytes
    with served(film) as server:
        *_, picture = gphoto2(server.port, home, *READY, TO_HOST, "capture")
    assert picture["size"] == film.size
    assert picture["sha256"] == hashlib.sha256(film.delivered[0]).hexdigest()


def test_bulb(home: dict[str, str]) -> None:
    film = Film()
    steps = ("set:iso=200", "set:aperture=8", "set:shutterspeed=bulb", TO_CARD, "bulb:0.2")
    with served(film) as server:
        *_, picture = gphoto2(server.port, home, *steps)
    ((exposure_s, *settings),) = film.taken
    assert settings == [200, 8.0]
    assert exposure_s not in (0.0, 1 / 64), "as long as was asked, not as on the dial"
    assert picture["sha256"] == hashlib.sha256(film.delivered[0]).hexdigest()


def test_a_camera_that_knows_the_standard_only(home: dict[str, str]) -> None:
    film = Film(size=300_000)
    with served(film, body=STANDARD) as server:
        summary, *read_back, picture = gphoto2(
            server.port, home, "summary", *STANDARD_READY, "capture"
        )
    for said in ("simulated PTP camera", "0730100001", "Generic Image Capture", "Exposure Time"):
        assert said in summary
    assert read_back == ["400", "f/4", "0.2500s"]
    assert film.taken == [Taken(0.25, 400, 4.0)]
    assert picture["sha256"] == hashlib.sha256(film.delivered[0]).hexdigest()
    assert picture["name"] == "DSC_0001.DNG"


@pytest.mark.campaign
def test_one_host_after_another_and_after_one_that_was_killed(home: dict[str, str]) -> None:
    film = Film()
    with served(film) as server:
        gphoto2(server.port, home, *READY)
        with running(command(server.port, *READY, "wait"), home) as host:
            assert host.stdout is not None
            assert host.stdout.readline() == "here\n"
            done = subprocess.run(
                command(server.port, "summary"), env=home, capture_output=True, timeout=MAX_S
            )
            assert done.returncode != 0, "one at a time"
        *_, picture = gphoto2(server.port, home, *READY, TO_HOST, "capture")
    assert picture["sha256"] == hashlib.sha256(film.delivered[0]).hexdigest()


def test_the_command_serves_until_it_is_interrupted(home: dict[str, str]) -> None:
    arguments = [sys.executable, "-m", "labrig", "sim", "camera", "--port", "0"]
    with running(arguments, home) as labrig:
        assert labrig.stdout is not None
        address = labrig.stdout.readline().strip()
        assert address.startswith("ptpip://127.0.0.1:")
        (summary,) = gphoto2(int(address.rpartition(":")[2]), home, "summary")
        assert "Canon EOS 5D Mark II" in summary
        labrig.send_signal(signal.SIGINT)
        said, complaint = labrig.communicate(timeout=MAX_S)
    assert (labrig.returncode, said, complaint) == (130, "", "labrig: interrupted\n")
