"""Custom functions as real cameras sent them, and cameras that tell less."""

import struct

import pytest

from drivers.ptp.eos_custom import CustomFunction, CustomFunctions, parse_custom_functions

from .bench import bench
from .toy_eos import OPERATIONS, ToyEos

# As libgphoto2's canon-eos-customfunc.txt prints them (hexadecimal): a 5D Mark II, group by group.
FIVE_D_MARK_II = (
    "68,1,1,5c,7,101,1,1,102,1,1,103,1,0,104,1,0,105,1,0,108,1,0,10f,1,0",
    "50,1,2,44,5,201,1,0,202,1,0,203,1,0,204,1,0,205,1,0",
    "84,1,3,78,8,505,1,0,506,1,0,50f,1,0,510,1,0,50e,1,0,60f,1,1,508,1,0,507,5,0,ff,0,ff,0",
    "68,1,4,5c,7,701,1,0,702,1,0,704,1,0,706,1,0,80b,1,0,80f,1,0,70b,1,0",
)


def block(numbers: str) -> bytes:
    words = [int(number, 16) for number in numbers.split(",")]
    return struct.pack(f"<{len(words)}I", *words)


def test_the_groups_of_a_5d_mark_ii_add_up() -> None:
    functions = CustomFunctions()
    for numbers in FIVE_D_MARK_II:
        functions.take(block(numbers))
    assert {f: functions.value(f) for f in CustomFunction} == {
        CustomFunction.iso_expansion: 0,
        CustomFunction.long_exposure_noise_reduction: 0,
        CustomFunction.highlight_tone_priority: 0,
        CustomFunction.mirror_lock_up: 1,
    }


def test_a_later_block_replaces_its_group() -> None:
    functions = CustomFunctions()
    functions.take(block(FIVE_D_MARK_II[2]))
    functions.take(block("20,1,3,14,1,60f,1,0"))
    assert functions.value(CustomFunction.mirror_lock_up) == 0


def test_all_groups_in_one_block() -> None:
    one = "34,2,2,14,1,201,1,1,3,14,1,60f,1,0"
    size = 4 * len(one.split(","))
    assert parse_custom_functions(block(one.replace("34", f"{size:x}", 1))) == {
        0x201: (1,),
        0x60F: (0,),
    }


def test_padding_behind_the_block_is_no_matter() -> None:
    assert parse_custom_functions(block("20,1,3,14,1,60f,1,1") + bytes(8)) == {0x60F: (1,)}


@pytest.mark.parametrize(
    "numbers",
    [
        "20,1",
        "24,1,3,14,1,60f,1,1",
        "20,2,3,14,1,60f,1,1",
        "20,1,3,18,1,60f,1,1",
        "20,1,3,14,2,60f,1,1",
        "20,1,3,14,1,60f,2,1",
        "20,1,3,14,1,60f,0,1",
        "20,1,3,14,1,60f,ffffffff,1",
        "20,1,3,ffffffff,1,60f,1,1",
        "20,ffffffff,3,14,1,60f,1,1",
        "20,1,3,14,1,60f,1,1,5",
        "20,0,3,14,1,60f,1,1",
        "0,0",
    ],
)
def test_what_does_not_add_up_is_not_believed(numbers: str) -> None:
    assert parse_custom_functions(block(numbers)) is None
    functions = CustomFunctions()
    functions.take(block("20,1,3,14,1,60f,1,0"))
    functions.take(block(numbers))
    assert functions.value(CustomFunction.mirror_lock_up) is None


@pytest.mark.parametrize("size", [0, 1, 7, 9, 8192])
def test_any_number_of_bytes_is_taken(size: int) -> None:
    assert parse_custom_functions(bytes(size)) is None


def test_a_camera_that_tells_little_is_looked_at_by_hand() -> None:
    found = bench().connect().findings()
    assert [finding.what for finding in found if finding.severity == "refuse"] == []
    by_hand = [str(finding) for finding in found if finding.severity == "warn"]
    assert len(by_hand) == 5
    for place in ("lens to MF", "Auto power off", "C.Fn II (Image) → 1", "C.Fn III"):
        assert any(place in text for text in by_hand)


def test_isos_of_the_rig_file_that_are_not_native_are_refused() -> None:
    found = bench().connect(isos=[100, 125, 160]).findings()
    (refused,) = [finding for finding in found if finding.severity == "refuse"]
    assert "ISO 125, 160, which are not native" in refused.what


@pytest.mark.parametrize(("seconds", "severity"), [(0, "fine"), (0xFFFFFFFF, "fine"), (60, "warn")])
def test_when_it_switches_itself_off(seconds: int, severity: str) -> None:
    toy = ToyEos()
    toy.values[0xD114] = struct.pack("<I", seconds)
    found = bench(toy).connect().findings()
    (severity_of_it,) = {
        finding.severity
        for finding in found
        if "off after" in finding.what or "auto power" in finding.what
    }
    assert severity_of_it == severity


def test_one_that_cannot_be_kept_awake_must_not_switch_itself_off() -> None:
    toy = ToyEos(tuple(code for code in OPERATIONS if code != 0x911D))
    toy.values[0xD114] = struct.pack("<I", 60)
    camera = bench(toy).connect()
    (finding,) = [found for found in camera.findings() if found.severity == "refuse"]
    assert "cannot be kept awake" in finding.what
    camera.keep_awake()
