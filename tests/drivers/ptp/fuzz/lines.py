"""The simulated camera behind a USB bus, or a network, that harms what passes over it."""

import select
import socket
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from typing import Any, NoReturn
from unittest.mock import patch

import numpy as np
import usb.core
from numpy.typing import NDArray

from labrig.acquire.connections import Connections, SerialPort
from labrig.drivers.ptp.ip import link as ip_link
from labrig.foundation.clock import VirtualClock
from labrig.sim.camera import CameraFaults, PtpIpServer
from labrig.sim.camera.responder import Responder
from labrig.sim.camera.usb.still_image import CANCEL, RESET, StillImageFunction
from tests.counterparts.served import Film

from ..usb.wire import (
    INTERRUPT_PACKET,
    PACKET,
    TRANSACTION_S,
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


class _Relay:
    """One connection of the PC's, passed on packet by packet to one of the camera's."""

    def __init__(self, port: int, to_camera: Mutator, to_host: Mutator) -> None:
        self.ours, self._near = socket.socketpair()
        self._far = socket.create_connection(("127.0.0.1", port), 5.0)
        self._near.setblocking(False)
        self._far.setblocking(False)
        self.ways = (
            _OneWay(self._near, self._far, to_camera),
            _OneWay(self._far, self._near, to_host),
        )

    @property
    def is_over(self) -> bool:
        """Whether both sides have hung up."""
        return all(way.is_over for way in self.ways)

    def close(self) -> None:
        for end in (self.ours, self._near, self._far):
            end.close()


class _OneWay:
    """From one end of a relay to the other."""

    def __init__(self, source: socket.socket, target: socket.socket, mutate: Mutator) -> None:
        self._source = source
        self._target = target
        self._mutate = mutate
        self._whole = bytearray()
        self._waiting = bytearray()
        self.is_over = False

    def fileno(self) -> int:
        """For `select`."""
        return self._source.fileno()

    @property
    def is_waiting(self) -> bool:
        """Whether the target has not taken all yet."""
        return bool(self._waiting)

    def pass_on(self) -> bool:
        """Whether anything came through."""
        try:
            received = self._source.recv(1 << 20)
        except BlockingIOError:
            received = None
        except OSError:
            received = b""
        if received:
            self._whole += received
            while (packet := self._next()) is not None:
                for mutated in self._mutate(packet):
                    self._waiting += mutated
        sent = 0
        try:
            while self._waiting and (sent := self._target.send(self._waiting)):
                del self._waiting[:sent]
        except BlockingIOError:
            pass
        except OSError:
            self._waiting.clear()  # nobody is there any more
        if received == b"" and not self._waiting:
            self.is_over = True
            with suppress(OSError):
                self._target.shutdown(socket.SHUT_WR)
        return bool(received or sent)

    def _next(self) -> bytes | None:
        size = max(8, int.from_bytes(self._whole[:4], "little"))
        if len(self._whole) < size:
            return None
        packet = bytes(self._whole[:size])
        del self._whole[:size]
        return packet


class _Network:
    """Connections of the PC's to the simulated camera's server; stands in for `select`, too."""

    def __init__(
        self, clock: VirtualClock, server: PtpIpServer, to_camera: Mutator, to_host: Mutator
    ) -> None:
        self.clock = clock
        self._server = server
        self._mutators = (to_camera, to_host)
        self._relays: list[_Relay] = []
        self._steps = 0

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        raise AssertionError("a camera has no serial port")

    def usb(self, address: str, serial_of: object = None) -> NoReturn:
        raise AssertionError("this camera is on the network")

    def tcp(self, address: str, default_port: int) -> socket.socket:
        self._relays.append(_Relay(self._server.port, *self._mutators))
        self._work()
        return self._relays[-1].ours

    def select(
        self, streams: Sequence[Any], _writing: object, _failing: object, patience_s: float
    ) -> tuple[list[Any], list[Any], list[Any]]:
        """`select.select` on the virtual clock, which only passes when nobody says anything."""
        for waited_s in (0.0, patience_s):
            self.clock.spend(waited_s)
            self._work()
            readable, _, _ = select.select(streams, [], [], 0.0)
            if readable:
                break
        self.clock.spend(TRANSACTION_S)
        return readable, [], []

    def close(self) -> None:
        for relay in self._relays:
            relay.close()

    def _work(self) -> None:
        """Until all that was said has been heard and answered."""
        has_passed = True
        self._pass_on()
        while has_passed:
            self._steps += 1
            assert self._steps < MAX_STEPS, "the driver hangs"
            self._server.serve_once(0.0)
            has_passed = self._pass_on()
        for relay in [relay for relay in self._relays if relay.is_over]:
            relay.close()
            self._relays.remove(relay)

    def _pass_on(self) -> bool:
        """Whether anything came through, either way."""
        ways = [way for relay in self._relays for way in relay.ways if not way.is_over]
        readable, _, _ = select.select(ways, [], [], 0.0)
        return sum(way.pass_on() for way in ways if way in readable or way.is_waiting) > 0


@contextmanager
def over_network(
    clock: VirtualClock, responder: Responder, to_camera: Mutator, to_host: Mutator
) -> Iterator[tuple[str, Connections]]:
    """An address, and connections to it, over PTP/IP."""
    with (
        closing(PtpIpServer(responder, clock.now)) as server,
        closing(_Network(clock, server, to_camera, to_host)) as network,
        patch.object(ip_link, "select", network),
    ):
        yield "ptpip://camera", network


Transport = Callable[
    [VirtualClock, Responder, Mutator, Mutator], AbstractContextManager[tuple[str, Connections]]
]
