"""The whole room: what a camera in it delivers, and that it can be repeated to the byte."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import exifread
import numpy as np
import pytest
import rawpy
from numpy.typing import NDArray

from labrig.foundation import resources
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UsageError
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation

SMALL = {"sample": "blue-paint", "sensor": {"width": 96, "height": 64, "flicker": 0.0}}
BRIGHTEST = {"blue-paint": 2, "red-paint": 0, "stickers": 1}


def make_room(**changed: Any) -> tuple[Room, VirtualClock]:
    simulation = Simulation.model_validate({**SMALL, **changed})
    clock = VirtualClock(simulation.epoch.timestamp())
    return Room(simulation, clock), clock


def charge(room: Room, clock: VirtualClock, duration_s: float = 600.0) -> None:
    room.switch_lamp(True)
    clock.spend(duration_s)
    room.switch_lamp(False)


def shoot(
    room: Room, clock: VirtualClock, exposure_s: float = 1.0, iso: int = 400, f_number: float = 4.0
) -> bytes:
    start_s = clock.now()
    clock.spend(exposure_s)
    return room.photograph(start_s, exposure_s, iso, f_number)


def mosaic(dng: bytes) -> NDArray[np.float64]:
    with rawpy.imread(io.BytesIO(dng)) as raw:
        return np.asarray(raw.raw_image_visible, dtype=np.float64) - 1024


def middle(dng: bytes) -> NDArray[np.float64]:
    """Mean R, G, B of the 16 × 16 pixels in the middle."""
    cell = mosaic(dng)[24:40, 40:56]
    green = (cell[0::2, 1::2].mean() + cell[1::2, 0::2].mean()) / 2
    return np.array([cell[0::2, 0::2].mean(), green, cell[1::2, 1::2].mean()])


def test_blue_paint_fills_half_of_the_range() -> None:
    room, clock = make_room()
    charge(room, clock, 3600.0)
    clock.spend(0.5)
    assert middle(shoot(room, clock)).max() == pytest.approx(0.5 * (15600 - 1024), rel=0.15)


def test_no_shipped_material_is_hopeless_or_off_the_scale() -> None:
    names = list(resources.names("config/materials"))
    regions = [(0.05 + 0.15 * (i % 6), 0.05 + 0.3 * (i // 6), 0.1, 0.2) for i in range(len(names))]
    room, clock = make_room(
        sample=[{"material": n, "region": r} for n, r in zip(names, regions, strict=True)]
    )
    charge(room, clock, 1800.0)
    for patch in room.truth().patches:
        total = np.sum([state.amplitude_dn_per_s or (0, 0, 0) for state in patch.states], axis=0)
        assert 500 < total.max() < 200_000, patch.material


@pytest.mark.parametrize("name", ["blue-paint", "red-paint", "stickers"])
def test_half_a_second_after_lamp_off_there_is_only_glow(name: str) -> None:
    room, clock = make_room(sample=name)
    charge(room, clock)
    clock.spend(0.5)
    frame = middle(shoot(room, clock, iso=100))
    (patch,) = room.truth(iso=100).patches
    (state,) = patch.states
    assert state.amplitude_dn_per_s is not None
    k = state.k_r_per_s
    glow = np.array(state.amplitude_dn_per_s) * (np.exp(-0.5 * k) - np.exp(-1.5 * k)) / k
    use = BRIGHTEST[name]
    if name == "stickers":  # their green is beyond the range
        use = 2
    assert frame[use] == pytest.approx(glow[use], rel=0.02)


def test_afterglow_of_the_lamp_is_gone_after_half_a_second() -> None:
    room, clock = make_room(initial_charge=0.0)
    room.switch_lamp(True)
    clock.spend(300.0)
    lit = middle(shoot(room, clock, exposure_s=2**-6, iso=100, f_number=5.6)) / 2**-6
    room.switch_lamp(False)
    clock.spend(0.5)
    left = middle(shoot(room, clock, exposure_s=1.0, iso=6400, f_number=4.0)) / 64 / (5.6 / 4) ** 2
    assert np.all(np.abs(left) < 1e-6 * lit)


def test_daylight_photograph_and_saturating_exposure() -> None:
    room, clock = make_room(initial={"lamp": "on"})
    assert room.lamp_on
    daylight = shoot(room, clock, exposure_s=2**-6, iso=100, f_number=5.6)
    assert np.all((middle(daylight) > 1000) & (middle(daylight) < 14_000))
    assert mosaic(daylight)[2:4, 2:4].max() < 0.2 * middle(daylight).max()
    assert mosaic(shoot(room, clock))[20:44, 30:66].min() > 15_600 - 1024


def test_an_exposure_across_lamp_off_sees_the_fade() -> None:
    room, clock = make_room()
    room.switch_lamp(True)
    clock.spend(60.0)
    start_s = clock.now()
    clock.spend(0.05)
    room.switch_lamp(False)
    clock.spend(0.95)
    across = middle(room.photograph(start_s, 1.0, 100, 32.0)) / 0.09
    lit_s = 0.05 + 0.045
    burning, burning_clock = make_room(initial={"lamp": "on"})
    burning_clock.spend(60.0)
    steady = middle(shoot(burning, burning_clock, 2**-4, 100, 32.0)) / 0.09 / 2**-4
    assert across == pytest.approx(steady * lit_s, rel=0.15)


def test_same_seed_same_bytes() -> None:
    def frames(seed: int) -> list[bytes]:
        room, clock = make_room(seed=seed)
        charge(room, clock)
        clock.spend(0.5)
        return [shoot(room, clock), shoot(room, clock)]

    once, again, other = frames(3), frames(3), frames(4)
    assert once == again
    assert once[0] != once[1]
    assert once[0] != other[0]


def test_what_comes_later_does_not_change_a_photograph() -> None:
    prompt_room, prompt_clock = make_room()
    charge(prompt_room, prompt_clock)
    prompt_clock.spend(0.5)
    start_s = prompt_clock.now()
    prompt = shoot(prompt_room, prompt_clock)

    late_room, late_clock = make_room()
    charge(late_room, late_clock)
    late_clock.spend(10.0)
    shoot(late_room, late_clock, exposure_s=2.0)
    late_room.switch_lamp(True)
    late_clock.spend(50.0)
    late_room.switch_lamp(False)
    assert late_room.photograph(start_s, 1.0, 400, 4.0) == prompt


def test_a_photograph_of_the_future_is_refused() -> None:
    room, clock = make_room()
    clock.spend(1.0)
    with pytest.raises(ValueError, match=r"expected an exposure between 0 s and 1\.0 s"):
        room.photograph(0.5, 1.0, 400, 4.0)


def test_patches_glow_apart_and_the_cloth_stays_dark() -> None:
    room, clock = make_room(
        sample=[
            {"material": "stickers", "region": [0, 0, 48, 32]},
            {"material": "green-paint", "region": [0, 32, 48, 32]},
        ]
    )
    charge(room, clock)
    clock.spend(0.5)
    frame = mosaic(shoot(room, clock, iso=100))
    stickers, green, cloth = frame[4:28, 4:44], frame[36:60, 4:44], frame[4:60, 52:92]
    assert stickers.mean() > 10 * green.mean() > 100
    assert cloth.mean() == pytest.approx(0, abs=2)


def test_a_dead_lamp_charges_nothing() -> None:
    room, clock = make_room(faults=["lamp_dead"])
    room.switch_lamp(True)
    assert room.lamp_on
    clock.spend(600.0)
    assert middle(shoot(room, clock)) == pytest.approx(0, abs=3)


def test_a_bulb_blows_and_makes_contact_again() -> None:
    room, clock = make_room(faults=[{"lamp_dead": {"at": "60 s", "for": "30 s"}}])
    room.switch_lamp(True)
    lit = []
    for at_s in (50.0, 80.0, 100.0):
        clock.spend(at_s - clock.now())
        lit.append(middle(shoot(room, clock, exposure_s=2**-6, iso=100, f_number=5.6)).max() > 1000)
        assert room.lamp_on, "the relay feeds it all the time"
    assert lit == [True, False, True]


def test_a_dead_contact_feeds_nothing() -> None:
    room, clock = make_room(faults=[{"relay_dead": {"at": "10 s", "for": "10 s"}}])
    room.switch_lamp(True)
    fed = []
    for at_s in (5.0, 15.0, 25.0):
        clock.spend(at_s - clock.now())
        fed.append(room.lamp_on)
    assert fed == [True, False, True]


def test_a_welded_contact_stays_closed_until_it_lets_go() -> None:
    room, clock = make_room(faults=[{"relay_welded": {"at": "10 s", "for": "50 s"}}])
    fed = []
    for at_s, asked in ((0, True), (5, False), (15, None), (20, True), (30, False), (61, None)):
        clock.spend(at_s - clock.now())
        if asked is not None:
            room.switch_lamp(asked)
        fed.append(room.lamp_on)
    assert fed == [True, False, False, True, True, False], "welding alone does not close it"


def test_a_contact_that_was_welded_before_the_room_was_opened_is_closed() -> None:
    simulation = Simulation.model_validate({**SMALL, "faults": [{"relay_welded": {"at": "10 s"}}]})
    later = simulation.opened_at(simulation.epoch.timestamp() + 20.0)
    room = Room(later, VirtualClock(later.epoch.timestamp()))
    assert room.lamp_on
    room.switch_lamp(False)
    assert room.lamp_on


def test_light_left_on_is_photographed_and_charges() -> None:
    room, clock = make_room(faults=[{"light_left_on": {"at": "10 s", "for": "600 s"}}])
    seen = []
    for at_s in (5.0, 300.0, 611.0):
        clock.spend(at_s - clock.now())
        seen.append(middle(shoot(room, clock, exposure_s=2**-4)).max())
    assert seen[0] == pytest.approx(0, abs=3)
    assert 500 < seen[1] < 10_000
    assert 5 < seen[2] < 0.2 * seen[1]


def test_a_residual_glow_can_be_set() -> None:
    room, clock = make_room(initial={"concentration": 0.5})
    assert middle(shoot(room, clock)).max() > 5000


def test_photographs_carry_the_virtual_wall_clock() -> None:
    room, clock = make_room(epoch="2026-05-04T03:02:01Z")
    clock.spend(3600.25)
    tags = exifread.process_file(io.BytesIO(shoot(room, clock, exposure_s=1 / 64)))
    assert str(tags["EXIF DateTimeOriginal"]) == "2026:05:04 04:02:01"
    assert str(tags["EXIF SubSecTimeOriginal"]) == "25"
    assert str(tags["EXIF ExposureTime"]) == "1/60"


def test_a_lens_names_itself_and_darkens_the_corners() -> None:
    def grey(lens: object) -> tuple[bytes, float]:
        room, clock = make_room(initial={"lamp": "on"}, lens=lens)
        clock.spend(1.0)
        room.tasks["grey card"]()
        dng = shoot(room, clock, 1 / 64, 100)
        frame = mosaic(dng)
        return dng, frame[:4, :4].mean() / frame[30:34, 46:50].mean()

    dng, falloff = grey({"name": "EF50mm f/1.4", "focal_mm": 50})
    tags = exifread.process_file(io.BytesIO(dng))
    assert str(tags["EXIF LensModel"]) == "EF50mm f/1.4"
    assert str(tags["EXIF FocalLength"]) == "50"
    silent, usual = grey(None)
    assert "EXIF LensModel" not in exifread.process_file(io.BytesIO(silent))
    assert usual == pytest.approx(0.86, abs=0.01)
    assert falloff == pytest.approx(0.72, abs=0.01)


def test_truth_before_and_after_lamp_off(tmp_path: Path) -> None:
    room, clock = make_room(sample="double-wide-slow")
    assert room.truth().lamp_off_s is None
    assert room.truth().patches[0].states[0].amplitude_dn_per_s is None
    clock.spend(5.0)
    charge(room, clock, 3000.0)
    before = room.truth()
    clock.spend(1.0)
    shoot(room, clock)
    room.write_truth(tmp_path / "truth.json")
    written: Mapping[str, Any] = json.loads((tmp_path / "truth.json").read_text("utf-8"))
    assert written == json.loads(before.model_dump_json())
    assert before.lamp_off_s == 3005.0
    fast, slow = before.patches[0].states
    assert (fast.k_r_per_s, slow.k_r_per_s) == (0.08, 0.004)
    assert fast.concentration is not None
    assert 0.3 < fast.concentration < 0.4


def test_amplitudes_scale_with_the_camera_settings() -> None:
    room, clock = make_room()
    charge(room, clock)
    (one,), (two,) = (
        room.truth(iso, f_number).patches[0].states for iso, f_number in ((400, 4.0), (800, 2.0))
    )
    assert one.amplitude_dn_per_s is not None
    assert two.amplitude_dn_per_s == pytest.approx([8 * value for value in one.amplitude_dn_per_s])


def test_unknown_material_is_named() -> None:
    with pytest.raises(UsageError, match="did you mean 'blue-paint'"):
        make_room(sample="blue-pant")
