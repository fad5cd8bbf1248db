import math
import struct
from time import process_time

import pytest
from hypothesis import given, settings, strategies as st

from labrig.sim.camera import BodySettings, CameraFaults
from tests.sim.camera.host import (
    AV,
    BUSY,
    DRIVE,
    ISO,
    OK,
    SHOTS,
    TO_CARD,
    TV,
    Bench,
)

LAG_S, JITTER_S = 0.063, 0.002


def test_a_capture_to_the_host_from_press_to_transfer_complete() -> None:
    bench = Bench(raw=bytes(range(256)) * 300)
    host = bench.ready()
    assert host.set(TV, 0x60).code == OK
    bench.clock.spend(0.05)
    assert host.values()[TV] == 0x60

    host.shoot()
    handle, size, name = host.photograph()
    assert name == "IMG_0001.DNG"
    assert size == len(bench.film.raw)

    received = b""
    while len(received) < size:
        part = host.do(0x9107, handle, len(received), 20_000)
        assert part.code == OK
        assert part.data
        received += part.data
    assert received == bench.film.raw
    assert host.do(0x9117, handle).code == OK
    assert host.do(0x9107, handle, 0, 10).code == 0x2009
    assert len(bench.film.taken) == 1


@pytest.mark.parametrize("operation", [0x1009, 0x9104])
def test_the_whole_object_in_one_operation(operation: int) -> None:
    bench = Bench()
    host = bench.ready()
    host.shoot()
    handle, _, _ = host.photograph()
    assert host.do(operation, handle).data == bench.film.raw


def test_the_generic_partial_object_counts_what_it_sends() -> None:
    bench = Bench(raw=b"x" * 100)
    host = bench.ready()
    host.shoot()
    handle, _, _ = host.photograph()
    part = host.do(0x101B, handle, 90, 50)
    assert (part.code, part.params, part.data) == (OK, (10,), b"x" * 10)
    assert host.do(0x101B, handle, 101, 1).code == 0x201D


sizes = st.integers(0, 5000) | st.integers(1, 40).map(lambda n: 512 * n - 12)


@settings(max_examples=30, deadline=None)
@given(size=sizes, packets=st.integers(1, 12))
def test_objects_arrive_byte_for_byte_whatever_the_packets(size: int, packets: int) -> None:
    raw = bytes(i * 7 % 251 for i in range(size))
    host = Bench(raw=raw).ready()
    host.shoot()
    handle, announced, _ = host.photograph()
    assert announced == size
    answer = host.do(0x9107, handle, 0, size, chunk=512 * packets)
    assert (answer.code, answer.data) == (OK, raw)


def test_a_large_object_costs_little_real_and_honest_virtual_time() -> None:
    bench = Bench(raw=bytes(2_600_000))
    host = bench.ready()
    host.shoot()
    handle, size, _ = host.photograph()
    used_s = []
    for _ in range(5):
        before_s, began_s = bench.clock.now(), process_time()
        host.do(0x1009, handle)
        used_s.append(process_time() - began_s)
        assert bench.clock.now() - before_s == pytest.approx(size / 35e6, rel=0.05)
    assert min(used_s) < 0.03


def test_the_shutter_opens_after_its_lag_for_its_true_time() -> None:
    for seed in range(10):
        bench = Bench(seed=seed)
        host = bench.ready()
        host.set(TV, 0x68)  # "1/60"
        host.set(AV, 0x30)  # "f/5.6"
        host.set(ISO, 0x5B)  # "500"
        pressed_s = host.shoot()
        host.photograph()
        (taken,) = bench.film.taken
        assert taken.exposure_s == 2.0**-6
        assert taken.f_number == pytest.approx(2.0**2.5)
        assert taken.iso == 500
        assert abs(taken.start_s - pressed_s - LAG_S) < 5 * JITTER_S
        assert taken.asked_at_s > taken.start_s + taken.exposure_s


def test_the_jitter_is_seeded() -> None:
    starts = []
    for seed in (1, 1, 2):
        bench = Bench(seed=seed)
        host = bench.ready()
        host.shoot()
        host.photograph()
        starts.append(bench.film.taken[0].start_s)
    assert starts[0] == starts[1] != starts[2]


def test_nothing_is_reported_before_the_exposure_is_over() -> None:
    bench = Bench()
    host = bench.ready()
    host.set(TV, 0x30)  # 2 s
    pressed_s = host.shoot()
    bench.clock.spend(0.1)
    while bench.clock.now() < pressed_s + LAG_S - 5 * JITTER_S + 2.0:
        assert 0xC186 not in [code for code, _ in host.events()]
        assert host.do(0x911D).code == BUSY
        bench.clock.spend(0.05)
    assert bench.film.taken == []
    host.photograph()
    assert bench.clock.now() > pressed_s + 2.0 + LAG_S + 0.15
    assert host.do(0x911D).code == OK


def test_a_file_that_nobody_fetches_is_never_computed() -> None:
    bench = Bench()
    host = bench.ready()
    host.shoot()
    bench.clock.spend(5.0)
    assert bench.film.taken == []


def test_full_press_is_busy_until_the_lens_is_focused_and_the_last_file_made() -> None:
    bench = Bench(body=BodySettings(autofocus=True))
    host = bench.ready()
    assert host.do(0x9128, 1, 0).code == OK
    assert host.do(0x9128, 2, 0).code == BUSY
    bench.clock.spend(0.11)
    assert host.do(0x9128, 2, 0).code == OK
    host.do(0x9129, 2)
    assert host.do(0x9128, 2, 0).code == BUSY
    host.photograph()
    assert host.do(0x9128, 2, 0).code == OK
    host.do(0x9129, 3)
    host.photograph()
    assert len(bench.film.taken) == 2


def test_the_button_must_come_up_between_two_photographs() -> None:
    host = Bench().ready()
    assert host.do(0x9128, 2, 1).code == OK
    host.photograph()
    assert host.do(0x9128, 2, 1).code == BUSY
    host.do(0x9129, 2)
    assert host.do(0x9128, 2, 1).code == OK


@pytest.mark.parametrize(("autofocus", "settling_s"), [(True, 0.1), (False, 0.02)])
def test_without_a_half_press_focusing_is_added_to_the_lag(
    autofocus: bool, settling_s: float
) -> None:
    bench = Bench(body=BodySettings(autofocus=autofocus))
    host = bench.ready()
    before_s = bench.clock.now()
    assert host.do(0x9128, 2, 0).code == OK
    host.photograph()
    lag_s = bench.film.taken[0].start_s - before_s
    assert lag_s == pytest.approx(LAG_S + settling_s, abs=5 * JITTER_S)


def test_the_older_release_presses_and_lets_go() -> None:
    bench = Bench()
    host = bench.ready()
    answer = host.do(0x910F)
    assert (answer.code, answer.params) == (OK, (0,))
    host.photograph()
    assert host.do(0x910F).code == OK


def test_the_self_timer_waits() -> None:
    bench = Bench()
    host = bench.ready()
    host.set(DRIVE, 0x11)
    pressed_s = host.shoot()
    host.photograph()
    assert bench.film.taken[0].start_s > pressed_s + 2.0


def test_a_bulb_exposure_lasts_until_the_button_comes_up() -> None:
    bench = Bench()
    host = bench.ready()
    host.set(TV, 0x0C)
    host.do(0x9128, 2, 1)
    bench.clock.spend(7.0)
    assert host.do(0x911D).code == BUSY
    assert host.do(0x9129, 2).code == OK
    host.photograph()
    assert bench.film.taken[0].exposure_s == pytest.approx(7.0, abs=0.15)


def test_bulb_operations_want_the_bulb_setting() -> None:
    bench = Bench()
    host = bench.ready()
    assert host.do(0x9125).code == 0x2002
    host.set(TV, 0x0C)
    assert host.do(0x9126).code == 0x2002
    assert host.do(0x9125).code == OK
    bench.clock.spend(3.0)
    assert host.do(0x9126).code == OK
    host.photograph()
    assert math.isclose(bench.film.taken[0].exposure_s, 3.0, abs_tol=0.15)


def test_no_room_on_the_host_no_photograph() -> None:
    host = Bench().ready()
    host.do(0x911A, 0, 0, 1)
    assert host.values()[SHOTS] == 0
    assert host.do(0x9128, 2, 1).code == 0x200C


def test_the_next_host_must_say_again_that_it_has_room() -> None:
    host = Bench().ready()
    host.do(0x1003)
    host.do(0x1002, 1, transaction_id=0)
    host.do(0x9114, 1)
    assert host.do(0x9128, 2, 1).code == 0x200C


def test_a_capture_to_the_card_is_listed_described_and_deleted() -> None:
    bench = Bench()
    host = bench.ready(TO_CARD)
    host.shoot()
    payload = host.wait_for(0xC181)
    handle, storage, object_format, _, _, size, parent = struct.unpack_from("<7I", payload)
    assert (storage, object_format, size) == (0x00010001, 0x3811, len(bench.film.raw))
    assert payload[32:].rstrip(b"\0") == b"IMG_0001.DNG"

    everything = host.do(0x1007, 0xFFFFFFFF, 0, 0).data
    assert everything is not None
    assert handle in struct.unpack(f"<{len(everything) // 4}I", everything)[1:]
    assert host.do(0x1007, storage, 0, parent).data == struct.pack("<II", 1, handle)
    assert host.do(0x1007, storage, 0, 77).code == 0x201A
    assert host.do(0x1007, 99).code == 0x2008

    info = host.do(0x1008, handle).data
    assert info is not None
    assert struct.unpack_from("<IHHI", info) == (storage, object_format, 0, size)
    assert "IMG_0001.DNG".encode("utf-16-le") in info
    assert "20260101T000000".encode("utf-16-le") in info
    assert host.do(0x1008, parent).code == OK

    assert host.do(0x9117, handle).code == OK
    assert host.do(0x1009, handle).data == bench.film.raw
    assert host.do(0x100B, parent).code == 0x200D
    assert host.do(0x100B, handle).code == OK
    assert host.do(0x1009, handle).code == 0x2009


def test_storage_has_room_for_what_it_says() -> None:
    host = Bench().ready(TO_CARD)
    assert host.do(0x1004).data == struct.pack("<II", 1, 0x00010001)
    info = host.do(0x1005, 0x00010001).data
    assert info is not None
    kind, _, _, capacity, free = struct.unpack_from("<HHHQQ", info)
    assert kind == 4
    assert 0 < free < capacity


def test_names_count_on() -> None:
    host = Bench().ready()
    names = []
    for _ in range(3):
        host.shoot()
        names.append(host.photograph()[2])
    assert names == ["IMG_0001.DNG", "IMG_0002.DNG", "IMG_0003.DNG"]


def test_busy_releases_are_counted() -> None:
    bench = Bench(faults=CameraFaults(busy_releases=2))
    host = bench.ready()
    assert [host.do(0x9128, 2, 1).code for _ in range(3)] == [BUSY, BUSY, OK]


def test_one_event_is_lost_and_the_next_is_not() -> None:
    bench = Bench(faults=CameraFaults(lost_event=True))
    host = bench.ready()
    host.shoot()
    bench.clock.spend(5.0)
    assert 0xC186 not in [code for code, _ in host.events()]
    host.shoot()
    assert host.photograph()[2] == "IMG_0002.DNG"
