"""A camera of the PTP standard that reports late, twice, too much, too little, or full cards."""

from collections import deque
from dataclasses import replace
from typing import Any

import pytest

from labrig.acquire.values import ExposureSettings
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import DeviceError

from .toy import (
    ADDED,
    COMPLETE,
    DAY,
    DEVICE_INFO_CHANGED,
    FOLDER,
    JPEG,
    OPERATIONS,
    STORE_FULL,
    File,
    ToyStandard,
    connect,
)

EXPOSURE_S = 1.0
GET_OBJECT, DELETE, PARTIAL = 0x1009, 0x100B, 0x101B


def frame(number: int) -> File:
    return File(f"DSC_{number:04d}.NEF", f"frame {number}".encode(), captured=f"{DAY}{number:02d}")


def usual(number: int) -> list[tuple[float, File | int]]:
    return [(1.2, frame(number)), (1.3, COMPLETE)]


def toy(*captures: list[tuple[float, File | int]]) -> ToyStandard:
    return ToyStandard(captures=deque(captures))


def test_what_somebody_takes_by_hand_is_neither_taken_for_a_frame_nor_deleted() -> None:
    t = toy(usual(1), usual(2))
    t.report(0.0, File("MINE_001.NEF"))
    camera = connect(t)
    t.report(0.0, File("MINE_002.NEF"))
    assert camera.shoot().data == b"frame 1"
    t.report(0.0, File("MINE_003.NEF"))
    assert camera.shoot().data == b"frame 2"
    camera.arm()
    assert [file.name for file in t.files.values()] == [f"MINE_00{n}.NEF" for n in (1, 2, 3)]


def test_a_copy_that_a_second_card_gets_late_is_not_the_next_frame() -> None:
    copy = File("DSC_0001.NEF", b"frame 1", captured=f"{DAY}01", storage=0x00020001)
    t = toy([(1.2, frame(1)), (1.6, COMPLETE), (2.5, copy)], usual(2))
    camera = connect(t)
    assert camera.shoot().data == b"frame 1"
    assert camera.shoot().data == b"frame 2"
    camera.arm()
    assert t.files == {}


def test_a_camera_that_begins_its_numbers_anew_is_understood() -> None:
    again = File("DSC_0001.NEF", b"frame 2", captured=f"{DAY}59")
    t = toy(usual(1), [(1.2, again), (1.3, COMPLETE)])
    camera = connect(t)
    assert [camera.shoot().data, camera.shoot().data] == [b"frame 1", b"frame 2"]


def test_what_says_nothing_of_a_frame_is_passed_over() -> None:
    t = toy(
        [
            (0.1, DEVICE_INFO_CHANGED),
            (0.2, 0xC801),
            (0.3, File("100NIKON", object_format=FOLDER)),
            (0.4, File("DSC_0001.JPG", object_format=JPEG)),
            (1.2, frame(1)),
        ]
    )
    assert connect(t).shoot().data == b"frame 1"


def test_a_file_that_is_deleted_in_the_camera_at_once_is_none() -> None:
    t = toy([(0.5, ADDED), *usual(1)])
    t.events.append((0.0, ADDED, 99))
    camera = connect(t)
    t.events.append((0.6, ADDED, 98))
    assert camera.shoot().data == b"frame 1"


def test_the_end_is_waited_for_once_by_a_camera_that_never_tells_it() -> None:
    t = toy([(1.2, frame(1))], [(1.2, frame(2))], [(1.2, frame(3))])
    camera = connect(t)
    took_s = []
    for _ in range(3):
        camera.shoot()
        before_s = t.clock.now()
        camera.arm()
        took_s.append(t.clock.now() - before_s)
    assert took_s[0] == pytest.approx(3.1, abs=0.2)
    assert took_s[1] == took_s[2] == pytest.approx(0.1, abs=0.05)


@pytest.mark.parametrize(
    ("capture", "said"),
    [
        ([], "within 7 s .*no ObjectAdded 0x4002"),
        ([(0.5, COMPLETE)], "within 7 s .*no ObjectAdded 0x4002"),
        ([(1.1, STORE_FULL)], "StoreFull 0x400A"),
        ([(1.1, File("DSC_0001.JPG", object_format=JPEG))], r"RAW.*DSC_0001\.JPG.*0x3801"),
        ([(1.1, File("DSC_0001.JPG"))], r"RAW.*DSC_0001\.JPG.*0x3000"),
        ([(1.1, File("DSC_0001.NEF", b""))], r"RAW.*of 0 bytes"),
        ([(1.1, File("DSC_0001.NEF", b"12345", announced_bytes=9))], "expected 9 bytes .* sent 5"),
    ],
)
def test_what_is_no_frame_is_reported_and_the_next_one_is_good(
    capture: list[tuple[float, File | int]], said: str
) -> None:
    t = toy(capture, usual(2))
    camera = connect(t, transfer_timeout="7 s")
    with pytest.raises(DeviceError, match=said) as caught:
        camera.shoot()
    assert "\n" not in str(caught.value)
    for step in camera.steps_to_safety():
        step()
    assert camera.shoot().data == b"frame 2"


@pytest.mark.parametrize("end", [[(1.3, COMPLETE)], []])
def test_a_camera_set_to_jpeg_is_refused_as_soon_as_that_is_known(
    end: list[tuple[float, File | int]],
) -> None:
    t = toy([(1.1, File("DSC_0001.JPG", object_format=JPEG)), *end])
    camera = connect(t)
    before_s = t.clock.now()
    with pytest.raises(DeviceError, match="RAW"):
        camera.shoot()
    assert t.clock.now() - before_s == pytest.approx(1.3 if end else 1.1 + 3.0, abs=0.3)


def test_a_release_that_is_refused_leaves_nothing_to_wait_for() -> None:
    t = toy()
    camera = connect(t)
    with pytest.raises(DeviceError, match="0x200C StoreFull"):
        camera.shoot()
    before_s = t.clock.now()
    t.captures.append(usual(1))
    assert camera.shoot().data == b"frame 1"
    assert t.clock.now() - before_s < 2.0


def test_a_long_exposure_that_was_broken_off_is_waited_for_and_discarded() -> None:
    t = toy([(30.3, frame(1))], usual(2))
    t.properties[0x500D] = (6, 300_000)
    camera = connect(t)
    camera.arm()
    t.clock.interrupt(2)
    with pytest.raises(Interrupted):
        camera.shoot()
    with t.clock.shielded():
        for step in camera.steps_to_safety():
            step()
    assert t.clock.now() < 1.0, "the way to the safe state does not wait for it"
    assert camera.shoot().data == b"frame 2"
    assert [file.name for file in t.files.values()] == ["DSC_0002.NEF"]


@pytest.mark.parametrize(
    ("operations", "asked"), [(OPERATIONS, PARTIAL), (OPERATIONS - {PARTIAL}, GET_OBJECT)]
)
def test_files_come_in_pieces_where_the_camera_can(operations: frozenset[int], asked: int) -> None:
    t = toy([(1.2, File("DSC_0001.NEF", bytes(3_000_000)))])
    t.operations = operations
    assert len(connect(t).shoot().data) == 3_000_000
    transfers = [code for code, *_ in t.log if code in (GET_OBJECT, PARTIAL)]
    assert transfers == [asked] * (3 if asked == PARTIAL else 1)


def test_a_card_that_cannot_be_cleared_does_not_end_a_run() -> None:
    t = toy(usual(1), usual(2), usual(3))
    t.refuses_to_delete = True
    camera = connect(t)
    assert [camera.shoot().data for _ in range(2)] == [b"frame 1", b"frame 2"]
    t.log.clear()
    t.operations = OPERATIONS - {DELETE}
    camera = connect(t)
    assert camera.shoot().data == b"frame 3"
    camera.arm()
    assert DELETE not in {code for code, *_ in t.log}
    assert any("cannot be deleted" in str(each) for each in camera.findings())


@pytest.mark.parametrize(
    ("answers_after_s", "begun_s"),
    [
        (0.02, 0.01),  # when it has begun: in the middle
        (0.6, 0.3),  # slowly, but before the exposure's end
        (1.3, 0.15),  # when all is over: an exposure earlier
    ],
)
def test_an_exposure_begins_where_the_answer_lets_it_begin(
    answers_after_s: float, begun_s: float
) -> None:
    t = toy(usual(1))
    t.answers_after_s = answers_after_s
    camera = connect(t, shutter_lag="50 ms")
    camera.arm()
    asked_s = t.clock.now()
    frame = camera.shoot()
    assert frame.start_s - asked_s == pytest.approx(begun_s + 0.05)
    assert frame.end_s - frame.start_s == pytest.approx(EXPOSURE_S)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"formats": frozenset({0x3801, 0x380D})}, "no RAW format (it lists 0x3801, 0x380D)"),
        ({"reports": frozenset({COMPLETE})}, "does not report its frames"),
        ({"properties": {0x500D: (6, 10_000)}}, "does not report its ISO"),
        ({"properties": {0x500F: (4, 400)}}, "does not report its shutter time"),
        ({"properties": {0x500D: (6, 10_000), 0x500F: (4, 0xFFFF)}}, "automatic ISO"),
        ({"properties": {0x500E: (4, 2)}}, "chooses exposures (exposure program (0x500E) = 0x2)"),
        ({"properties": {0x500A: (4, 2)}}, "autofocus is on"),
        ({"properties": {0x5013: (4, 2)}}, "more than one frame"),
        ({"properties": {0x5012: (6, 2000)}}, "self-timer"),
        ({"properties": {0x5018: (4, 3)}}, "burst"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_cannot_work_is_refused(changed: dict[str, Any], said: str) -> None:
    refused = [
        each.what
        for each in connect(replace(toy(), **changed)).findings()
        if each.severity == "refuse"
    ]
    assert any(said in what for what in refused), refused


def test_what_cannot_be_set_is_offered_as_it_stands() -> None:
    camera = connect(toy(usual(1)))
    capabilities = camera.capabilities()
    assert (capabilities.exposures_s, capabilities.isos, capabilities.f_numbers) == (
        (1.0,),
        (400,),
        (),
    )
    assert camera.configure(ExposureSettings(1.0, 400)) == ExposureSettings(1.0, 400)
    for settings, what in (
        (ExposureSettings(2.0, 400), "shutter time"),
        (ExposureSettings(1.0, 200), "ISO"),
        (ExposureSettings(1.0, 400, 5.6), "by hand"),
    ):
        with pytest.raises(DeviceError, match=what):
            camera.configure(settings)


def test_what_a_pc_can_set_is_set_when_it_connects() -> None:
    t = toy()
    t.properties |= {0x5013: (4, 2), 0x5012: (6, 2000), 0x5018: (4, 5), 0x500A: (4, 2)}
    t.choices = {0x5013: (1, 2), 0x5012: (0, 2000), 0x5018: (5, 6)}
    refused = [each.what for each in connect(t).findings() if each.severity == "refuse"]
    assert [t.properties[prop][1] for prop in (0x5013, 0x5012, 0x5018, 0x500A)] == [1, 0, 5, 2]
    assert len(refused) == 2
    assert "autofocus" in refused[0]
    assert "burst" in refused[1]


def test_a_setting_that_the_camera_does_not_take_is_reported() -> None:
    t = toy()
    t.choices = {0x500D: (10_000, 20_000), 0x500F: (200, 400)}
    camera = connect(t)
    assert camera.configure(ExposureSettings(2.0, 200)) == ExposureSettings(2.0, 200)
    t.stubborn = frozenset({0x500D})
    with pytest.raises(DeviceError, match=r"exposure time \(0x500D\) = 10000, it says 20000"):
        camera.configure(ExposureSettings(1.0, 400))


def test_a_camera_that_does_not_tell_its_iso_is_used_at_the_rig_files_only_one() -> None:
    t = replace(toy(usual(1)), properties={0x500D: (6, 10_000)})
    camera = connect(t, isos=[800])
    assert camera.shoot().settings.iso == 800
    assert any("the rig file says 800" in each.what for each in camera.findings())
    with pytest.raises(DeviceError, match="that one alone"):
        connect(t).capabilities()


@pytest.mark.parametrize("units", [0, 24, 400_000, 0xFFFFFFFF])
def test_a_shutter_time_that_is_none_is_refused(units: int) -> None:
    t = replace(toy(), properties={0x500D: (6, units), 0x500F: (4, 400)})
    for attempt in (connect(t).capabilities, connect(t).arm):
        with pytest.raises(DeviceError, match="shutter time"):
            attempt()
