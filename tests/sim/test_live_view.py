"""Looking through the simulated camera into the simulated room, with the real driver."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from labrig.acquire import CAMERA, LAMP, LiveView, read_rig_file
from labrig.bench import open_bench
from labrig.foundation.clock import VirtualClock
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation

Make = Callable[..., Path]
#: The middle of the frame is the sample, its corner is cloth.
SENSOR = {"width": 192, "height": 128}


def look(path: Path, lamp: bool = False) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as rig:
        camera = rig[CAMERA]
        assert isinstance(camera, LiveView)
        if lamp:
            rig[LAMP].on()
            rig.clock.sleep(1.0)
        picture = cv2.imdecode(np.frombuffer(camera.preview(), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture.astype(np.float64)


def test_with_the_room_light_on_the_sample_is_seen(make_rig: Make) -> None:
    picture = look(make_rig(sensor=SENSOR))
    assert picture.shape == (64, 96, 3)
    assert picture[28:36, 42:54].mean() > 3 * picture[:6, :6].mean()
    assert picture.max() < 250


def test_a_dark_room_is_noise(make_rig: Make) -> None:
    picture = look(make_rig(sensor=SENSOR, room_light=False))
    assert picture[28:36, 42:54].mean() == pytest.approx(picture[:6, :6].mean(), abs=5)
    assert picture.std() > 0
    assert picture.mean() < 40


def test_the_lamp_is_metered(make_rig: Make) -> None:
    picture = look(make_rig(sensor=SENSOR, room_light=False), lamp=True)
    assert 60 < picture[28:36, 42:54].mean() < 250


def test_looking_changes_no_photograph() -> None:
    def photograph(looks: int) -> bytes:
        clock = VirtualClock()
        room = Room(Simulation.model_validate({"sample": "blue-paint", "sensor": SENSOR}), clock)
        room.switch_lamp(True)
        for second in range(looks):
            clock.sleep_until(10.0 + second)
            room.preview(clock.now())
        clock.sleep_until(60.0)
        room.switch_lamp(False)
        clock.sleep_until(70.0)
        return room.photograph(65.0, 1.0, 400, 4.0)

    plain, looked = (np.frombuffer(photograph(looks), np.uint8) for looks in (0, 3))
    # Followed in other steps, the samples differ by rounding: a handful of pixels by one.
    assert np.mean(plain != looked) < 1e-3
