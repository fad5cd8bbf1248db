"""The simulated camera behind a USB bus that harms what passes over it."""

from array import array
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np
import usb.core
from numpy.typing import NDArray

from labrig.acquire.connections import Connections
from labrig.foundation.clock import VirtualClock
from labrig.sim.camera import CameraFaults
from labrig.sim.camera.responder import Responder
from labrig.sim.camera.usb.still_image import CANCEL, RESET, StillImageFunction
from tests.counterparts.served import Film

from ..usb.wire import (
    INTERRUPT_PACKET,
    PACKET,
    OneDevice,
    Wire,
)
from .mutations import Mutator

#: A session that needs more steps hangs; real ones need some hundreds.
MAX_STEPS = 20_000
_ALL = 1 << 30


class LiveFilm(Film):
    """A sensor that can also be looked through."""

    def preview(self, at_s: float) -> NDArray[np.uint8]:
        return np.full((8, 12, 3), 128, np.uint8)


class Function:
    """The camera's USB function at the far end of a `Wire`."""

    def __init__(self, clock: VirtualClock, responder: Responder) -> None:
        self._function = StillImageFunction(clock, responder, CameraFaults())

    def written(self, wire: Wire, data: bytes) -> None:
        try:
            self._function.write(data)
            if len(data) % PACKET == 0:
                self._function.write(b"")
            while (transfer := self._function.read(_ALL)) is not None:
                wire.send(bytes(transfer))
        except usb.core.USBError:
            wire.halted = True

    def control(self, wire: Wire, request: int, data: bytes) -> bytes:
        if request not in (CANCEL, RESET):
            return self._function.request_in(request)
        self._function.request_out(request, data)
        wire.to_host.clear()
        return b""

    def clear_halt(self, endpoint: int) -> None:
        self._function.clear_halt(endpoint)

    def event(self, clock: VirtualClock, patience_s: float) -> bytes | None:
        """What the camera reports by itself within so many seconds."""
        wait_s = max(0.0, self._function.interrupt_due_s() - clock.now())
        if wait_s > patience_s:
            return None
        clock.spend(wait_s)
        return bytes(self._function.read_interrupt(_ALL))


class MutatedWire(Wire):
    """A USB bus that harms containers."""

    def __init__(
        self, clock: VirtualClock, responder: Responder, to_camera: Mutator, to_host: Mutator
    ) -> None:
        self._function = Function(clock, responder)
        super().__init__(self._function, clock)
        self._to_camera = to_camera
        self._to_host = to_host

    def send(self, transfer: bytes) -> None:
        for mutated in self._to_host(transfer):
            super().send(mutated)

    def bulk_write(self, handle: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
        if not data:
            return 0  # it ends a container of whole packets, as below
        for mutated in self._to_camera(bytes(data)):
            super().bulk_write(handle, ep, intf, array("B", mutated), timeout)
            if mutated and len(mutated) % PACKET == 0:
                super().bulk_write(handle, ep, intf, array("B"), timeout)
        return len(data)

    def intr_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        if not self.interrupts and (event := self._function.event(self.clock, timeout / 1e3)):
            for mutated in self._to_host(event):
                pieces = range(0, len(mutated), INTERRUPT_PACKET)
                self.interrupts += [mutated[at : at + INTERRUPT_PACKET] for at in pieces]
        return super().intr_read(handle, ep, intf, buff, timeout)

    def clear_halt(self, handle: Any, ep: int) -> None:
        super().clear_halt(handle, ep)
        self._function.clear_halt(ep)


@contextmanager
def over_usb(
    clock: VirtualClock, responder: Responder, to_camera: Mutator, to_host: Mutator
) -> Iterator[tuple[str, Connections]]:
    """An address, and connections to it, over USB."""
    yield "usb://04a9:3199", OneDevice(MutatedWire(clock, responder, to_camera, to_host))


Transport = Callable[
    [VirtualClock, Responder, Mutator, Mutator], AbstractContextManager[tuple[str, Connections]]
]
