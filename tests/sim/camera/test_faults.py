import contextlib

import pytest
import usb.core
import usb.util

from labrig.sim.camera import CameraFaults
from tests.sim.camera.host import IN, OK, OUT, TV, Bench

PIPE, GONE = 32, 19


def test_a_data_phase_stalls_once() -> None:
    bench = Bench(faults=CameraFaults(stall_at=0x9107))
    host = bench.ready()
    host.shoot()
    handle, size, _ = host.photograph()
    with pytest.raises(usb.core.USBError) as stall:
        host.do(0x9107, handle, 0, size)
    assert stall.value.errno == PIPE
    host.device.clear_halt(IN)
    host.device.clear_halt(OUT)
    assert host.do(0x9107, handle, 0, size).data == bench.film.raw


def test_a_data_phase_of_the_host_stalls_once_and_changes_nothing() -> None:
    bench = Bench(faults=CameraFaults(stall_at=0x1016))
    host = bench.ready()
    text = b"\x02x\0\0\0"
    with pytest.raises(usb.core.USBError) as stall:
        host.do(0x1016, 0xD406, data=text)
    assert stall.value.errno == PIPE
    host.device.clear_halt(IN)
    host.device.clear_halt(OUT)
    assert host.do(0x1015, 0xD406).data != text
    assert host.do(0x1016, 0xD406, data=text).code == OK


def test_an_answer_that_never_comes_was_obeyed() -> None:
    bench = Bench(faults=CameraFaults(timeout_once_at=0x9128))
    host = bench.ready()
    before_s = bench.clock.now()
    with pytest.raises(usb.core.USBTimeoutError):
        host.do(0x9128, 2, 1)
    assert bench.clock.now() - before_s > 1.0
    host.photograph()
    assert host.do(0x9129, 2).code == OK


def test_unplugged_at_a_time_everything_fails() -> None:
    bench = Bench(faults=CameraFaults(unplug_at_s=2.0))
    host = bench.ready()
    bench.clock.spend(2.0)
    for act in (
        lambda: host.do(0x911D),
        lambda: host.device.read(IN, 512),
        lambda: host.device.read(0x83, 64),
        lambda: host.device.clear_halt(IN),
        lambda: host.device.ctrl_transfer(0xA1, 0x67, 0, 0, 4),
        lambda: host.device.reset(),
    ):
        with pytest.raises(usb.core.USBError) as gone:
            act()
        assert gone.value.errno == GONE
    assert usb.core.find(backend=bench.camera.backend) is None
    usb.util.dispose_resources(host.device)


def test_unplugged_during_a_time_out_it_fails_at_that_moment() -> None:
    bench = Bench(faults=CameraFaults(unplug_at_s=2.0))
    host = bench.ready()
    with pytest.raises(usb.core.USBError) as gone:
        host.device.read(IN, 512, timeout=60_000)
    assert gone.value.errno == GONE
    assert bench.clock.now() == pytest.approx(2.0)


def test_unplugged_in_a_transfer_and_back_as_a_new_device() -> None:
    faults = CameraFaults(unplug_after_bytes=20_000, replug_after_s=1.0)
    bench = Bench(raw=bytes(50_000), faults=faults)
    host = bench.ready()
    host.shoot()
    handle, size, _ = host.photograph()
    with pytest.raises(usb.core.USBError) as gone:
        host.do(0x9107, handle, 0, size, chunk=4096)
    assert gone.value.errno == GONE
    assert usb.core.find(backend=bench.camera.backend) is None
    bench.clock.spend(1.1)
    with pytest.raises(usb.core.USBError) as gone:
        host.do(0x911D)
    assert gone.value.errno == GONE
    again = bench.ready()
    assert again.device.address != host.device.address
    assert again.do(0x9107, handle, 0, 10).code == 0x2009
    again.shoot()
    assert again.photograph()[1] == size


def test_a_card_survives_unplugging() -> None:
    bench = Bench(faults=CameraFaults(unplug_at_s=10.0, replug_after_s=1.0))
    host = bench.ready(destination=2)
    host.shoot()
    bench.clock.spend(15.0)
    with contextlib.suppress(usb.core.USBError):
        host.do(0x911D)
    again = bench.ready(destination=2)
    listed = again.do(0x1007, 0xFFFFFFFF, 0x3811, 0).data
    assert listed is not None
    assert listed[:4] == b"\1\0\0\0"


def test_an_exposure_begun_before_the_reset_is_reported_to_whoever_comes_next() -> None:
    bench = Bench()
    host = bench.ready()
    host.set(TV, 0x28)  # 4 s
    host.shoot()
    host.device.reset()
    again = bench.ready()
    assert again.photograph()[2] == "IMG_0001.DNG"
