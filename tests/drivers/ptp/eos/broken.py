"""An EOS camera that fails."""

import pytest

from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError

from .bench import Bench, photograph
from .toy import Fault

BROKEN = (Fault.REFUSED, Fault.STALLED, Fault.SILENT, Fault.GARBAGE)


def assert_usable(b: Bench, camera: PtpCamera) -> None:
    """Safe now, and the next frame is the next exposure's."""
    camera.make_safe()
    assert not b.toy.buttons
    frame = photograph(camera)
    assert frame.data == b.toy.frame(b.toy.exposures)
    assert b.toy.is_idle
    camera.disconnect()
    assert not b.toy.session_open
    assert not b.wire.claimed


def assert_one_helpful_line(error: pytest.ExceptionInfo[DeviceError]) -> None:
    message = str(error.value)
    assert "\n" not in message
    assert ": " in message


class InterruptingClock(VirtualClock):
    """Somebody presses Ctrl-C just before the nth wait."""

    def __init__(self, at_wait: int) -> None:
        super().__init__()
        self._waits_left = at_wait

    def sleep_until(self, deadline_s: float) -> None:
        self._waits_left -= 1
        if self._waits_left == 0:
            self.interrupt(2)
        super().sleep_until(deadline_s)
