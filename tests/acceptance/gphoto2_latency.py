"""Time that libgphoto2 adds before the shutter opens, and the driver's error of that moment.

    python -m tests.acceptance.gphoto2_latency [--frames 20]

The simulated camera, in a process of its own, opens its shutter 63 ms after the full press has
arrived and says when that was, on the clock that all processes share. For each way to release:
milliseconds from `shoot` to the full press, and the driver's start of the exposure less the true
one.
"""

import argparse
import json
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

from labrig.acquire import ExposureSettings
from labrig.drivers.gphoto2_camera import Gphoto2Camera
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import SystemClock, VirtualClock
from labrig.sim.camera import BodySettings, Pace, PtpIpServer, SimulatedCamera
from tests.drivers.gphoto2_camera.bench import TIFF, Loopback

#: A half press is over by then, as it is in a run.
SETTLING_S = 0.5
SHUTTER_LAG_S = 0.063
SETTINGS = ExposureSettings(1 / 64, 400, 5.6)
WAYS: dict[str, tuple[type[Any], dict[str, str]]] = {
    "ptp_camera": (PtpCamera, {}),
    "gphoto2, remote button": (Gphoto2Camera, {"release": "button"}),
    "gphoto2, trigger_capture": (Gphoto2Camera, {"release": "trigger"}),
}


class Tell:
    """A sensor that says when it was exposed."""

    def __init__(self, zero_s: float) -> None:
        self._zero_s = zero_s

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        print(json.dumps(start_s + self._zero_s), flush=True)
        return TIFF + random.Random(start_s).randbytes(30_000)


def serve(autofocus: bool) -> None:
    """The camera; its address first, then the start of each exposure."""
    clock, room_clock = SystemClock(), VirtualClock()
    pace = Pace(clock, room_clock)
    tell = Tell(clock.now() - pace.catch_up())
    camera = SimulatedCamera(
        room_clock, tell, serial="1", seed=1, shutter_lag_s=SHUTTER_LAG_S, shutter_jitter_s=0.0,
        body=BodySettings(autofocus=autofocus),
    )  # fmt: skip
    with closing(PtpIpServer(camera.responder, pace.catch_up)) as server:
        print(server.address, flush=True)
        server.serve(clock)


@contextmanager
def served(autofocus: bool) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    command = [sys.executable, "-m", "tests.acceptance.gphoto2_latency", "--serve"]
    command += ["--autofocus"] if autofocus else []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            yield server.stdout.readline().strip(), server
        finally:
            server.kill()


def measure(way: str, autofocus: bool, frames: int) -> str:
    """One line."""
    driver, keys = WAYS[way]
    settings = driver.Settings(shutter_lag=f"{SHUTTER_LAG_S} s", **keys)
    delays_ms, errors_ms = [], []
    with served(autofocus) as (address, server):
        assert server.stdout is not None
        camera = driver(address, settings, Loopback())
        try:
            camera.make_safe()
            camera.configure(SETTINGS)
            for _ in range(frames):
                camera.arm()
                time.sleep(SETTLING_S)
                asked_s = SystemClock().now()
                frame = camera.shoot()
                true_s = json.loads(server.stdout.readline())
                delays_ms.append(1e3 * (true_s - SHUTTER_LAG_S - asked_s))
                errors_ms.append(1e3 * (frame.start_s - true_s))
        finally:
            camera.disconnect()
    return (
        f"{way:26} {'AF' if autofocus else 'MF'}"
        f"{statistics.median(delays_ms):10.1f} {min(delays_ms):9.1f} {max(delays_ms):7.1f}"
        f"{statistics.mean(errors_ms):+12.2f} ± {statistics.stdev(errors_ms):.2f}"
        f" {min(errors_ms):+9.2f} {max(errors_ms):+7.2f}"
    )


def main() -> None:
    """Print a line per way and lens."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--serve", action="store_true")
    parser.add_argument("--autofocus", action="store_true")
    asked = parser.parse_args()
    if asked.serve:
        serve(asked.autofocus)
    print(
        f"{f'ms, {asked.frames} frames each':30}  shoot to full press: median, least, most", end=""
    )
    print("   start_s less the true one: mean ± sd, least, most")
    for autofocus in (False, True):
        for way in WAYS:
            print(measure(way, autofocus, asked.frames), flush=True)


if __name__ == "__main__":
    main()
