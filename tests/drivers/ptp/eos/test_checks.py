"""Custom functions as real cameras sent them, and cameras that tell less."""

import struct

import pytest

from labrig.drivers.ptp.eos.custom_functions import (
    CustomFunction,
    CustomFunctions,
    parse_custom_functions,
)

from .bench import bench
from .toy import OPERATIONS, ToyEos

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
    manual_steps = [str(finding) for finding in found if finding.severity == "warn"]
    assert len(manual_steps) == 6
    for place in ("lens to MF", "Auto power off", "C.Fn II (Image) → 1", "C.Fn III"):
        assert any(place in text for text in manual_steps)


@pytest.mark.parametrize(
    ("model", "highest", "is_known"),
    [
        ("Canon EOS 30D", 1600, True),
        ("Canon EOS 5D Mark II", 3200, True),
        ("Canon EOS 6D", 6400, True),
        ("Canon EOS R5", 1600, False),
    ],
)
def test_native_isos_are_those_of_the_model(model: str, highest: int, is_known: bool) -> None:
    toy = ToyEos()
    toy.model = model
    toy.lists[0xD103] = (0x00, *range(0x48, 0x89))
    camera = bench(toy).connect()
    isos = camera.capabilities().isos
    assert isos == tuple(100 * 2**stop for stop in range(len(isos)))
    assert isos[-1] == highest
    warned = [found for found in camera.findings() if "ISOs of a" in found.what]
    assert len(warned) == (not is_known)
    assert all(model in found.what and "'isos'" in found.remedy for found in warned)


def test_what_the_rig_file_says_is_native_goes_before_it() -> None:
    toy = ToyEos()
    toy.model = "Canon EOS 5D Mark II"
    toy.values[0xD103] = struct.pack("<I", 0x4B)  # ISO 125
    (refused,) = [f for f in bench(toy).connect().findings() if f.severity == "refuse"]
    assert "ISO 125 is not native" in refused.what
    assert "ISO button" in refused.remedy
    found = bench(toy).connect(isos=[100, 125, 160]).findings()
    assert [finding for finding in found if finding.severity == "refuse"] == []
    (warned,) = [finding for finding in found if "rig file" in finding.what]
    assert "ISO 125, 160, which is not native in a Canon EOS 5D Mark II" in warned.what


@pytest.mark.parametrize(
    ("seconds", "severity"), [(0, "fine"), (0xFFFFFFFF, "fine"), (60, "refuse")]
)
def test_when_it_switches_itself_off(seconds: int, severity: str) -> None:
    toy = ToyEos()
    toy.values[0xD114] = struct.pack("<I", seconds)
    found = bench(toy).connect().findings()
    (severity_of_it,) = {
        finding.severity
        for finding in found
        if "switches itself off" in finding.what or "auto power" in finding.what
    }
    assert severity_of_it == severity


def test_one_that_cannot_be_kept_awake_is_left_alone() -> None:
    toy = ToyEos(tuple(code for code in OPERATIONS if code != 0x911D))
    camera = bench(toy).connect()
    said = len(toy.log)
    camera.keep_awake()
    assert len(toy.log) == said
