"""The PTP driver and the simulated camera, written apart from the same facts, meet here."""

from typing import Any

import pytest

from labrig.acquire import Camera, Checkable, ExposureSettings, KeptAwake, Rig, Session
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.sim.camera import BodySettings, CameraFaults, SimulatedCamera
from tests.drivers.ptp.simulated.wired import Picture, StoppingClock, Wired

SETTINGS = ExposureSettings(1.0, 400, 4.0)
BUSY, OPEN_SESSION, GET_EVENT, RELEASE_ON, GET_PARTIAL = 0x2019, 0x1002, 0x9116, 0x9128, 0x9107


def bench(
    size: int = 70_000, body: BodySettings | None = None, **faults: Any
) -> tuple[StoppingClock, Picture, SimulatedCamera, PtpCamera]:
    clock, picture = StoppingClock(), Picture(size)
    camera = SimulatedCamera(
        clock,
        picture,
        serial="1",
        seed=1,
        faults=CameraFaults(**faults),
        body=body or BodySettings(),
    )
    settings = PtpCamera.Settings(shutter_lag="63 ms")
    return clock, picture, camera, PtpCamera("sim://room/camera", settings, Wired(clock, camera))


@pytest.mark.parametrize("size", [500, 512 * 40 - 12, 512 * 40, 2 * 1024 * 1024, 2_600_001])
def test_frames_arrive_whole_with_their_true_times(size: int) -> None:
    _, picture, _, driver = bench(size)
    assert isinstance(driver, Camera)
    for exposure_s in (1 / 64, 1.0, 2.0):
        in_force = driver.configure(ExposureSettings(exposure_s, 400, 4.0))
        driver.arm()
        frame = driver.shoot()
        start_s, true_exposure_s = picture.taken[-1]
        assert in_force.exposure_s == true_exposure_s == frame.settings.exposure_s
        assert frame.start_s == pytest.approx(start_s, abs=0.012)
        assert frame.end_s - frame.start_s == pytest.approx(true_exposure_s)
        assert len(frame.data) == size
        assert frame.data[:32] == picture.photograph(start_s, true_exposure_s, 400, 4.0)[:32]
        assert frame.suffix == ".dng"
    driver.make_safe()
    driver.disconnect()


def test_an_armed_camera_releases_at_once() -> None:
    clock, picture, _, driver = bench()
    driver.configure(SETTINGS)
    driver.arm()
    clock.sleep(0.2)  # a half press takes the lens its time, before the moment that counts
    asked_s = clock.now()
    driver.shoot()
    assert picture.taken[0][0] - asked_s < 0.075, "63 ms are the body's own lag"


@pytest.mark.parametrize(
    "faults",
    [
        {"busy_releases": 3},
        {"stall_at": GET_PARTIAL},
        {"lost_event": True},
        {"timeout_once_at": GET_PARTIAL},
        {"timeout_once_at": RELEASE_ON},
        {"stall_at": GET_EVENT},
        {"stall_at": RELEASE_ON},
        {"timeout_once_at": GET_EVENT},
    ],
    ids=str,
)
def test_a_fault_is_mended_or_said_and_the_next_frame_is_good(faults: dict[str, Any]) -> None:
    try:
        _, picture, _, driver = bench(**faults)
    except DeviceError as error:
        assert "\n" not in str(error)
        return
    for attempt in range(3):
        try:
            driver.configure(SETTINGS)
            driver.arm()
            frame = driver.shoot()
        except DeviceError as error:
            assert "\n" not in str(error)
            assert attempt < 2, "the fault strikes once"
            driver.make_safe()
            continue
        start_s, exposure_s = picture.taken[-1]
        assert frame.data[:32] == picture.photograph(start_s, exposure_s, 400, 4.0)[:32]
        return
    pytest.fail("no frame in three attempts")


@pytest.mark.parametrize("waits", range(1, 60, 3))
def test_interrupted_at_any_wait_it_is_made_safe_and_no_frame_is_taken_for_another(
    waits: int,
) -> None:
    clock, picture, _, driver = bench()
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
    driver.configure(ExposureSettings(0.5, 400, 4.0))
    driver.arm()
    frame = driver.shoot()
    start_s, exposure_s = picture.taken[-1]
    assert frame.settings.exposure_s == exposure_s == 0.5
    assert frame.start_s == pytest.approx(start_s, abs=0.012)
    assert frame.data[:32] == picture.photograph(start_s, exposure_s, 400, 4.0)[:32]


@pytest.mark.parametrize("after_bytes", [100, 3_000, 20_000, 60_000, 100_000])
def test_unplugged_is_one_clear_line(after_bytes: int) -> None:
    def photograph() -> None:
        _, _, _, driver = bench(unplug_after_bytes=after_bytes)
        for _ in range(3):
            driver.configure(SETTINGS)
            driver.arm()
            driver.shoot()

    with pytest.raises(DeviceLostError) as caught:
        photograph()
    assert "\n" not in str(caught.value)


def test_what_a_killed_program_left_behind_is_taken_over() -> None:
    clock, _, camera, driver = bench()
    driver.configure(SETTINGS)
    driver.arm()
    camera.lose_host()
    again = PtpCamera("sim://room/camera", PtpCamera.Settings(), Wired(clock, camera))
    again.configure(SETTINGS)
    again.arm()
    assert len(again.shoot().data) == 70_000


def test_what_the_camera_does_not_offer_is_refused() -> None:
    *_, driver = bench()
    with pytest.raises(DeviceError, match="ISO"):
        driver.configure(ExposureSettings(1.0, 125, 4.0))
    assert 400 in driver.capabilities().isos


class Nobody:
    """Neither records nor watches."""

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments, **keys: None


def test_a_camera_that_switches_itself_off_survives_a_charge_because_it_is_kept_awake() -> None:
    clock, picture, _, driver = bench(body=BodySettings(auto_power_off="60 s"))
    assert isinstance(driver, KeptAwake)
    session = Session(Rig("bench", clock, {"camera": driver}, {}), Nobody(), Nobody())
    driver.configure(SETTINGS)
    session.wait(600.0, "charging")
    assert clock.now() == pytest.approx(600.0, abs=1.0)
    driver.arm()
    driver.shoot()
    assert len(picture.taken) == 1


def test_a_camera_left_alone_switches_itself_off_and_says_so_in_one_line() -> None:
    clock, _, _, driver = bench(body=BodySettings(auto_power_off="60 s"))
    driver.configure(SETTINGS)
    clock.sleep(61.0)
    with pytest.raises(DeviceError, match="automatic switching-off") as caught:
        driver.arm()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("body", "severity", "said"),
    [
        (BodySettings(exposure_mode="Av"), "refuse", "dial is at Av"),
        (BodySettings(exposure_mode="B"), "refuse", "dial is at B"),
        (BodySettings(autofocus=True), "refuse", "lens to MF"),
        (BodySettings(iso="auto"), "refuse", "automatic ISO"),
        (BodySettings(iso=125), "refuse", "ISO 125 is not native"),
        (BodySettings(auto_power_off="60 s"), "refuse", "Set-up 1 (yellow) → Auto power off → Off"),
        (BodySettings(long_exposure_noise_reduction=True), "refuse", "C.Fn II (Image) → 1"),
        (BodySettings(highlight_tone_priority=True), "refuse", "C.Fn II (Image) → 3"),
        (BodySettings(mirror_lock_up=True), "refuse", "C.Fn III (Autofocus/Drive) → 6"),
    ],
    ids=str,
)
def test_what_is_set_by_hand_is_found(body: BodySettings, severity: str, said: str) -> None:
    *_, driver = bench(body=body)
    assert isinstance(driver, Checkable)
    (found,) = [finding for finding in driver.findings() if finding.severity != "fine"]
    assert found.severity == severity
    assert said in str(found)


def test_a_well_set_camera_is_fine() -> None:
    *_, driver = bench()
    assert {finding.severity for finding in driver.findings()} == {"fine"}


def test_a_camera_that_has_lost_the_session_gets_another_on_the_way_to_the_safe_state() -> None:
    _, picture, camera, driver = bench()
    driver.configure(SETTINGS)
    camera.responder.disconnect()
    for code in ("0x2003 SessionNotOpen", "lost this session, it answered 0x2003"):
        with pytest.raises(DeviceError, match=code):
            driver.configure(ExposureSettings(0.5, 400, 4.0))
    driver.make_safe()
    driver.configure(SETTINGS)
    driver.arm()
    assert driver.shoot().data == picture.photograph(*picture.taken[-1], 400, 4.0)
