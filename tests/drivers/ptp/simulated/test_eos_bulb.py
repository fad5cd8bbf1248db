"""Exposures at bulb of the simulated camera: what was recorded is what the shutter did."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.acquire import ExposureSettings
from labrig.drivers.ptp import PtpCamera
from labrig.foundation import resources
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.record import read_run
from labrig.reduce.dark import fit_dark
from labrig.sim.camera import BodySettings, CameraFaults, SimulatedCamera
from tests.conftest import Ended
from tests.drivers.ptp.simulated.wired import Picture, StoppingClock, Wired
from tests.quick_yaml import read_quickly, write_quickly

ADDRESS = "sim://room/camera"
LONG, SHORT = ExposureSettings(64.0, 400, 4.0), ExposureSettings(0.5, 400, 4.0)
SETTINGS = PtpCamera.Settings(shutter_lag="83 ms", longest_exposure="128 s")
#: How far the camera's own lags are off what the rig file says: jitter, and the second curtain.
LAGS_S = 0.02


class Bench:
    """A camera on a cable, and the driver."""

    def __init__(self, body: BodySettings | None = None, **faults: float) -> None:
        self.clock, self.picture = StoppingClock(), Picture(70_000)
        self.camera = SimulatedCamera(
            self.clock,
            self.picture,
            serial="1",
            seed=1,
            faults=CameraFaults(**faults),  # type: ignore[arg-type]
            body=body or BodySettings(),
        )
        self.driver = self.connect()

    def connect(self) -> PtpCamera:
        return PtpCamera(ADDRESS, SETTINGS, Wired(self.clock, self.camera))

    def expect_a_good_frame(self, settings: ExposureSettings) -> None:
        """And the right one."""
        assert self.driver.configure(settings) == settings
        self.driver.arm()
        frame = self.driver.shoot()
        start_s, exposure_s = self.picture.taken[-1]
        assert frame.settings.exposure_s == pytest.approx(settings.exposure_s, abs=0.01)
        assert frame.settings.exposure_s == pytest.approx(exposure_s, abs=LAGS_S)
        assert frame.start_s == pytest.approx(start_s, abs=LAGS_S)
        assert frame.data[:32] == self.picture.photograph(start_s, exposure_s, 400, 4.0)[:32]


@pytest.mark.parametrize(
    "body",
    [BodySettings(), BodySettings(exposure_mode="B"), BodySettings(auto_power_off="60 s")],
    ids=["M", "B", "switches itself off"],
)
def test_frames_say_how_long_they_were_exposed(body: BodySettings) -> None:
    bench = Bench(body)
    assert bench.driver.capabilities().exposures_s[-2:] == (64.0, 128.0)
    for exposure_s in (64.0, 128.0):
        bench.expect_a_good_frame(ExposureSettings(exposure_s, 400, 4.0))
    if body.exposure_mode == "M":
        bench.expect_a_good_frame(SHORT)
    bench.driver.make_safe()
    bench.driver.disconnect()


@pytest.mark.parametrize("waits", range(1, 16))
def test_interrupted_at_any_wait_the_shutter_closes_at_once_and_the_frame_is_discarded(
    waits: int,
) -> None:
    bench = Bench()
    bench.driver.configure(LONG)
    bench.clock.waits_left = waits
    try:
        bench.driver.arm()
        bench.driver.shoot()
    except Interrupted:
        pass
    bench.clock.waits_left = -1
    stopped_s = bench.clock.now()
    bench.driver.make_safe()
    assert bench.clock.now() < stopped_s + 1.0
    bench.expect_a_good_frame(SHORT)
    assert bench.clock.now() < stopped_s + 10.0, "nobody waits for what was broken off"
    bench.expect_a_good_frame(LONG)


def test_unplugged_while_it_exposes_and_back_again() -> None:
    bench = Bench(unplug_at_s=30.0, replug_after_s=100.0)
    bench.driver.configure(LONG)
    bench.driver.arm()
    with pytest.raises(DeviceLostError, match="cable"):
        bench.driver.shoot()
    with pytest.raises(DeviceError, match="cable"):
        bench.driver.make_safe()
    bench.driver.disconnect()
    bench.clock.sleep_until(131.0)
    bench.driver = bench.connect()
    bench.expect_a_good_frame(SHORT)
    bench.expect_a_good_frame(LONG)


def test_a_program_that_was_killed_leaves_the_shutter_open_and_the_next_closes_it() -> None:
    bench = Bench()
    bench.driver.configure(LONG)
    bench.driver.arm()
    bench.clock.waits_left = 1
    with pytest.raises(Interrupted):
        bench.driver.shoot()
    bench.camera.lose_host()
    bench.driver = bench.connect()
    bench.expect_a_good_frame(SHORT)


def test_dark_frames_of_slightly_other_measured_lengths_count() -> None:
    lengths_s = np.array([64.0012, 64.0035, 63.9991])
    model = fit_dark(lengths_s, np.full((3, 1), 7.0), np.ones((3, 1)))
    level, _ = model.dark_level(64.0127)
    assert level == pytest.approx(7.0)


def test_a_slow_decay_in_exposures_of_64_s(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    k_r_per_s = 0.004
    sample = read_quickly((resources.folder("config/materials") / "blue-paint.yaml").read_text())
    sample["states"][0]["k_r_per_s"] = k_r_per_s
    (tmp_path / "slow.yaml").write_text(write_quickly(sample))
    rig = make_rig(sample=str(tmp_path / "slow.yaml"))
    content = read_quickly(rig.read_text())
    content["devices"]["camera"]["longest_exposure"] = "64 s"
    rig.write_text(write_quickly(content))
    protocol = make_protocol(
        exposure="64 s", every="70 s", camera={"iso": 100, "f_number": 16}, **{"for": "12 min"}
    )
    ended = labrig("run", protocol, "--rig", rig, "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    run = read_run(ended.run_folder)
    exposures_s = [frame.exposure_s for frame in (*run.frames("dark"), *run.frames("decay"))]
    assert exposures_s == pytest.approx([64.0] * len(exposures_s), abs=0.01)
    fit = json.loads((ended.run_folder / "result" / "fit.json").read_text())
    (state,) = fit["states"]
    assert state["k_r_per_s_sigma"] < 0.05 * k_r_per_s
    assert abs(state["k_r_per_s"] - k_r_per_s) < 3 * state["k_r_per_s_sigma"]
