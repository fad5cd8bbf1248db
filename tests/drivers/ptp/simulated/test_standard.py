"""The PTP driver on a simulated camera that knows the PTP standard only."""

from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import Camera, Checkable, ExposureSettings, KeptAwake
from labrig.acquire.values import Frame
from labrig.drivers.ptp import PtpCamera
from labrig.drivers.ptp.standard import camera as standard_camera
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.sim.camera import BodySettings, CameraFaults, SimulatedCamera, StandardHabits
from labrig.sim.camera.vocabulary import ObjectFormat
from tests.conftest import Ended
from tests.drivers.ptp.simulated.wired import Picture, StoppingClock, Wired

SETTINGS = ExposureSettings(1.0, 400, 4.0)
RAW, JPEG = ObjectFormat.DNG, ObjectFormat.JPEG
CAPTURE, OBJECT_INFO, GET_PARTIAL, DELETE = 0x100E, 0x1008, 0x101B, 0x100B
GET_PROPERTY, SET_PROPERTY = 0x1015, 0x1016
#: Nothing is metered before the release: 63 ms of shutter and 20 ms of metering.
SHUTTER_LAG, JITTER_S = "83 ms", 0.012
Bench = tuple[StoppingClock, Picture, SimulatedCamera, PtpCamera]


def bench(
    size: int = 70_000,
    habits: StandardHabits | None = None,
    rig: dict[str, Any] | None = None,
    faults: CameraFaults | None = None,
    **set_by_hand: Any,
) -> Bench:
    clock, picture = StoppingClock(), Picture(size)
    camera = SimulatedCamera(
        clock,
        picture,
        serial="1",
        seed=1,
        faults=faults or CameraFaults(),
        body=BodySettings(body="standard", **set_by_hand),
        habits=habits or StandardHabits(),
    )
    settings = PtpCamera.Settings.model_validate({"shutter_lag": SHUTTER_LAG} | (rig or {}))
    return clock, picture, camera, PtpCamera("sim://room/camera", settings, Wired(clock, camera))


def photograph(driver: PtpCamera, settings: ExposureSettings = SETTINGS) -> Frame:
    driver.configure(settings)
    driver.arm()
    return driver.shoot()


def assert_is_last(frame: Frame, picture: Picture) -> None:
    """The frame is of the last exposure, and says when and how that was."""
    start_s, exposure_s = picture.taken[-1]
    assert frame.settings.exposure_s == exposure_s
    assert frame.start_s == pytest.approx(start_s, abs=JITTER_S)
    assert frame.end_s - frame.start_s == pytest.approx(exposure_s)
    assert frame.data[:32] == picture.photograph(start_s, exposure_s, 400, 4.0)[:32]


def on_card(camera: SimulatedCamera) -> list[str]:
    """Names of the files, asked past the driver."""
    return [stored.name for stored in camera.files]


@pytest.mark.parametrize("size", [500, 512 * 40 - 12, 512 * 40, 2_600_001])
def test_frames_arrive_whole_with_their_times(size: int) -> None:
    _, picture, camera, driver = bench(size)
    assert isinstance(driver, Camera)
    for exposure_s in (0.0156, 1.0, 2.0):
        frame = photograph(driver, ExposureSettings(exposure_s, 400, 4.0))
        assert_is_last(frame, picture)
        assert len(frame.data) == size
        assert frame.suffix == ".dng"
    driver.make_safe()
    driver.disconnect()
    assert on_card(camera) == ["DSC_0003.DNG"], "until the next one it is kept twice"


def test_it_offers_what_the_camera_lists_and_a_dial_label_is_understood() -> None:
    *_, driver = bench(rig={"isos": [100, 400], "longest_exposure": "10 s"})
    capabilities = driver.capabilities()
    assert capabilities.isos == (100, 400)
    assert capabilities.exposures_s[0] == pytest.approx(0.0025), (
        "shorter ones are told too coarsely"
    )
    assert capabilities.exposures_s[-1] == pytest.approx(8.0)
    assert capabilities.f_numbers[:2] == (1.8, 2.0)
    in_force = driver.configure(ExposureSettings(1 / 60, 400, 5.6))
    assert in_force == ExposureSettings(0.0156, 400, 5.6)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (ExposureSettings(1 / 90, 400, 4.0), "shutter time"),
        (ExposureSettings(1.0, 125, 4.0), "ISO"),
        (ExposureSettings(1.0, 400, 1.2), "f/1.8"),
        (ExposureSettings(float("nan"), 400, 4.0), "longer than 0 s"),
    ],
)
def test_what_the_camera_does_not_offer_is_refused(settings: ExposureSettings, said: str) -> None:
    *_, driver = bench()
    with pytest.raises(DeviceError, match=said):
        driver.configure(settings)


@pytest.mark.parametrize("end_reported", ["after", "before", "never"])
@pytest.mark.parametrize("files", [(RAW,), (RAW, JPEG), (JPEG, RAW)])
@pytest.mark.parametrize("has_second_card", [False, True])
def test_whatever_else_is_written_the_raw_file_is_taken_and_the_rest_deleted(
    end_reported: Any, files: tuple[ObjectFormat, ...], has_second_card: bool
) -> None:
    habits = StandardHabits(files, end_reported, has_second_card)
    _, picture, camera, driver = bench(habits=habits)
    for exposure_s in (1.0, 0.5, 0.0156):
        assert_is_last(photograph(driver, ExposureSettings(exposure_s, 400, 4.0)), picture)
    driver.arm()
    assert on_card(camera) == []


def test_a_camera_that_delivers_jpeg_is_refused_in_one_line_each_time() -> None:
    _, _, camera, driver = bench(habits=StandardHabits((JPEG,)))
    for _ in range(2):
        with pytest.raises(DeviceError, match=r"RAW.*'DSC_000[12]\.JPG'.*0x3801") as caught:
            photograph(driver)
        assert "\n" not in str(caught.value)
    driver.make_safe()
    assert on_card(camera) == []


def test_times_of_a_dial_are_used_as_told_and_reported_to_be_such() -> None:
    dial = {300_000: 32.0, 10_000: 1.0, 333: 1 / 32, 166: 1 / 64}
    *_, driver = bench(habits=StandardHabits(shutter_times=dial))
    assert driver.configure(ExposureSettings(1 / 64, 400, 4.0)).exposure_s == pytest.approx(0.0166)
    assert any("those of a dial" in finding.what for finding in driver.findings())
    *_, driver = bench()
    assert not any("those of a dial" in finding.what for finding in driver.findings())


@pytest.mark.parametrize(
    ("set_by_hand", "said"),
    [
        ({"exposure_mode": "Av"}, "dial to M"),
        ({"autofocus": True}, "to MF"),
        ({"iso": "auto"}, "automatic ISO"),
    ],
    ids=str,
)
def test_what_is_set_by_hand_and_spoils_photometry_is_refused(
    set_by_hand: dict[str, Any], said: str
) -> None:
    *_, driver = bench(**set_by_hand)
    assert isinstance(driver, Checkable)
    (found,) = [finding for finding in driver.findings() if finding.severity == "refuse"]
    assert said in str(found)


def test_a_well_set_camera_is_refused_nothing_but_warned_of_what_cannot_be_reported() -> None:
    *_, driver = bench(rig={"isos": [400]})
    warned = [finding.what for finding in driver.findings() if finding.severity == "warn"]
    assert len(warned) == 3
    assert any("83 ms by the rig file" in what for what in warned)
    assert any("whether it is set to RAW" in what for what in warned)
    assert any("automatic switching-off" in what for what in warned)
    assert not [finding for finding in driver.findings() if finding.severity == "refuse"]


def test_a_wrong_dial_photographs_nothing() -> None:
    _, picture, _, driver = bench(exposure_mode="P")
    for attempt in (driver.capabilities, driver.shoot, lambda: driver.configure(SETTINGS)):
        with pytest.raises(DeviceError, match="manual exposure"):
            attempt()
    assert picture.taken == []


def test_there_is_no_live_view() -> None:
    *_, driver = bench()
    with pytest.raises(DeviceError, match=r"simulated PTP camera.*viewfinder") as caught:
        driver.preview()
    assert "\n" not in str(caught.value)


def test_it_is_kept_awake() -> None:
    clock, _, _, driver = bench(auto_power_off="60 s")
    assert isinstance(driver, KeptAwake)
    for _ in range(4):
        clock.sleep(50.0)
        driver.keep_awake()
    clock.sleep(61.0)
    with pytest.raises(DeviceLostError):
        driver.keep_awake()


@pytest.mark.parametrize(
    "faults",
    [
        {"busy_releases": 3},
        {"lost_event": True},
        *({"timeout_once_at": code} for code in (CAPTURE, OBJECT_INFO, GET_PARTIAL, DELETE)),
        *({"stall_at": code} for code in (CAPTURE, OBJECT_INFO, GET_PARTIAL, GET_PROPERTY)),
        {"stall_at": SET_PROPERTY},
    ],
    ids=str,
)
def test_a_fault_is_mended_or_said_and_the_next_frame_is_good(faults: dict[str, Any]) -> None:
    _, picture, _, driver = bench(faults=CameraFaults(**faults))
    for attempt in range(3):
        try:
            frame = photograph(driver)
        except DeviceError as error:
            assert "\n" not in str(error)
            assert attempt < 2, "the fault strikes once"
            driver.make_safe()
            continue
        assert_is_last(frame, picture)
        return
    pytest.fail("no frame in three attempts")


@pytest.mark.parametrize("waits", range(1, 60, 3))
def test_interrupted_at_any_wait_it_is_made_safe_and_no_frame_is_taken_for_another(
    waits: int,
) -> None:
    clock, picture, camera, driver = bench(habits=StandardHabits((JPEG, RAW)))
    driver.configure(SETTINGS)
    clock.waits_left = waits
    try:
        for _ in range(2):
            driver.arm()
            driver.shoot()
    except Interrupted:
        pass
    clock.waits_left = -1
    with clock.shielded():
        driver.make_safe()
    assert_is_last(photograph(driver, ExposureSettings(0.5, 400, 4.0)), picture)
    driver.arm()
    assert on_card(camera) == []


@pytest.mark.parametrize("after_bytes", [100, 3_000, 60_000, 100_000])
def test_unplugged_is_one_clear_line(after_bytes: int) -> None:
    def photographs() -> None:
        *_, driver = bench(faults=CameraFaults(unplug_after_bytes=after_bytes))
        for _ in range(3):
            photograph(driver)

    with pytest.raises(DeviceLostError) as caught:
        photographs()
    assert "\n" not in str(caught.value)


def test_a_full_card_is_reported() -> None:
    *_, driver = bench(faults=CameraFaults(full_spans_s=((0.0, 1e9),)))
    with pytest.raises(DeviceError, match=r"0x200C StoreFull.*no room"):
        photograph(driver)


def test_a_session_left_behind_is_taken_over() -> None:
    clock, picture, camera, driver = bench()
    driver.configure(SETTINGS)
    camera.lose_host()
    again = PtpCamera("sim://room/camera", PtpCamera.Settings(), Wired(clock, camera))
    assert photograph(again).data[:32] == picture.photograph(*picture.taken[-1], 400, 4.0)[:32]


def test_a_whole_decay_is_measured_with_it(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    rig = make_rig(camera={"body": "standard"})
    arguments = ("--rig", rig, "--runs", tmp_path / "runs", "--no-process")
    ended = labrig("run", make_protocol(), *arguments)
    assert ended.code == 0, ended.err
    assert len(list(Path(ended.out.splitlines()[-1], "frames").glob("*.dng"))) > 10


class OfItsMaker(IntEnum):
    """Code of a release that the standard does not have, as makers add them."""

    Release = 0x9207


def test_a_release_of_the_makers_own_is_a_line_in_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    release = (OfItsMaker.Release, (0, 0))
    monkeypatch.setattr(standard_camera, "RELEASES", (release, *standard_camera.RELEASES))
    habits = StandardHabits(release=OfItsMaker.Release)
    _, picture, _, driver = bench(habits=habits)
    assert_is_last(photograph(driver), picture)
    _, picture, _, driver = bench()  # one without it
    assert_is_last(photograph(driver), picture)
    monkeypatch.undo()
    with pytest.raises(DeviceError, match=r"without .* 0x100E: set its USB mode"):
        bench(habits=habits)
