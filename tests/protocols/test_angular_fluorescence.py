"""Angular fluorescence: timeline, refusals, order of the views."""

from pathlib import Path
from typing import Any

import pytest

from labrig.foundation.errors import DeviceError
from labrig.protocols.angular_fluorescence.protocol import AngularFluorescence, AngularFrames
from labrig.record import read_run
from tests.analyse.angular_bench import record_angular
from tests.analyse.recorded import cut_off_and_resumed
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    written,
)


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("angular_fluorescence", "sim-fluorescent")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"angles": [30]}, "angles"),
        ({"angles": [30, 30]}, "every angle once"),
        ({"angles": [30, 200]}, "angles"),
        ({"directions": ["vertical", "vertical"]}, "every direction once"),
        ({"directions": ["oblique"]}, "directions"),
        ({"repositionings": 2}, "repositionings"),
        ({"leds": ["365 nm", "365 nm"]}, "every LED once"),
        ({"reflected_led": "625 nm"}, "'shape: sphere' only"),
        ({"shape": "sphere", "reflected_led": "365 nm"}, "not among 'leds'"),
        ({"shape": "cube"}, "shape"),
        ({"light": {"side": "behind"}}, "side"),
        ({"light": {"distance_radii": 1}}, "distance_radii"),
        ({"circle": {"centre": [0.5, 2], "radius": 0.1}}, "centre"),
        ({"angle": [30, 60]}, "did you mean 'angles'?"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    assert_one_clear_line(written(tmp_path, protocol="angular_fluorescence", **keys), said)


def test_every_round_has_every_angle_in_another_order() -> None:
    protocol = AngularFluorescence(repositionings=5, directions=("vertical",))
    angles = [pose.angle_deg for pose in protocol.poses()]
    assert angles[0] == angles[-1] == 30
    rounds = [angles[first : first + 6] for first in range(1, 31, 6)]
    assert all(sorted(one) == [30, 45, 60, 75, 90, 105] for one in rounds)
    assert len({tuple(one) for one in rounds}) > 1
    names = [unit.name for unit in protocol.units()]
    assert len(set(names)) == len(names)
    assert protocol.poses() == AngularFluorescence.model_validate(protocol.model_dump()).poses()


def test_every_led_is_metered_once_in_its_first_pose() -> None:
    protocol = AngularFluorescence(
        shape="sphere", leds=("365 nm", "455 nm"), reflected_led="625 nm"
    )
    names = [unit.name for unit in protocol.units()]
    assert names[:3] == ["meter 365 nm", "meter 455 nm", "meter 625 nm"]
    assert names[3] == "365 nm 1"
    assert "put-back" not in names


def test_an_led_that_does_not_light_ends_the_run(tmp_path: Path) -> None:
    def broken(rig: dict[str, Any]) -> None:
        rig["simulation"]["leds"][0]["level"] = "0.0000001 %"

    with pytest.raises(DeviceError, match="the 365 nm lamp did not light"):
        record_angular(tmp_path, {"longest": "1 s"}, broken)


def test_a_run_that_was_cut_off_goes_on_with_the_metered_exposure(tmp_path: Path) -> None:
    keys = {"angles": [30, 90], "directions": ["vertical"], "repositionings": 3}
    run = record_angular(tmp_path, keys)
    whole = read_run(run)
    cut, resumed = cut_off_and_resumed(run, "365 nm vertical 90° 2")
    assert len(cut.completed()) < len(whole.completed())
    assert list(resumed.completed()) == list(whole.completed())
    assert resumed.completed()["meter 365 nm"].uid == whole.completed()["meter 365 nm"].uid
    exposures_s = {frame.exposure_s for frame in resumed.frames(AngularFrames.VIEW)}
    assert exposures_s == {frame.exposure_s for frame in whole.frames(AngularFrames.VIEW)}
    assert len(exposures_s) == 1
