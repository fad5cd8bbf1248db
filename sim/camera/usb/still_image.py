"""The USB still-image function: three endpoints and four class requests in front of a responder."""

import struct
from collections import deque

from labrig.foundation.clock import Clock

from ... import usb_errors
from ..faults import CameraFaults
from ..responder import Responder
from ..vocabulary import ResponseCode
from .containers import (
    Assembler,
    Container,
    ContainerType,
    MalformedContainerError,
    encode,
    encode_parameters,
)


class InPipe:
    """Containers that wait to be read.

    A transfer ends with a packet shorter than the endpoint's, which is an empty one when a
    container fills its last packet. Bytes are copied in one piece; only the arithmetic is done
    in packets.

    Parameters
    ----------
    packet_size
        The endpoint's wMaxPacketSize.
    """

    def __init__(self, packet_size: int) -> None:
        self._packet_size = packet_size
        self._transfers: deque[memoryview] = deque()

    def __bool__(self) -> bool:
        return bool(self._transfers)

    def put(self, container: bytes) -> None:
        """Queue one container."""
        self._transfers.append(memoryview(container))

    def discard(self) -> None:
        """Discard everything that was not read."""
        self._transfers.clear()

    def take(self, room: int) -> memoryview:
        """Return what a read of `room` bytes receives of the first container."""
        transfer = self._transfers.popleft()
        whole_packets = room // self._packet_size * self._packet_size
        if room >= len(transfer):
            # A read that is filled exactly ends without seeing the empty packet behind it.
            if len(transfer) and room == len(transfer) and room == whole_packets:
                self._transfers.appendleft(memoryview(b""))
            return transfer
        if room == 0 or room != whole_packets:
            # The packet that did not fit has been acknowledged: it is lost.
            lost = whole_packets + self._packet_size
            if lost <= len(transfer):
                self._transfers.appendleft(transfer[lost:])
            raise usb_errors.overflowed()
        self._transfers.appendleft(transfer[room:])
        return transfer[:room]


BULK_IN, BULK_OUT, INTERRUPT_IN = 0x81, 0x02, 0x83
#: wMaxPacketSize at high speed.
BULK_PACKET = 512
INTERRUPT_PACKET = 8

#: Class requests of the still-image class.
CANCEL, RESET, GET_STATUS = 0x64, 0x66, 0x67
_CANCELLATION = 0x4001
#: After a cancel the camera clears its buffers and says that it is busy.
CANCEL_S = 0.002
_UNSOLICITED = 0xFFFFFFFF


class StillImageFunction:
    """Packets from and to the host, independent of pyusb's objects.

    Parameters
    ----------
    clock
        The room's clock.
    responder
        Responder of the camera.
    faults
        Faults of the camera, of which `stall_at` and `timeout_once_at` are here.
    """

    def __init__(self, clock: Clock, responder: Responder, faults: CameraFaults) -> None:
        self._clock = clock
        self._responder = responder
        self._stall_at = faults.stall_at
        self._swallow_at = faults.timeout_once_at
        self._out = Assembler(BULK_PACKET)
        self._in = InPipe(BULK_PACKET)
        self._interrupt = InPipe(INTERRUPT_PACKET)
        self._command: Container | None = None
        self._transaction_id = 0
        self._halted: set[int] = set()
        self._cancelling_until_s = 0.0

    def reset(self) -> None:
        """Restore the state after plugging in, the camera's session included."""
        self._discard_transaction()
        self._interrupt.discard()
        self._halted.clear()
        self._responder.disconnect()

    def clear_halt(self, endpoint: int) -> None:
        """Do ClearFeature(ENDPOINT_HALT)."""
        self._halted.discard(endpoint)

    def write(self, transfer: bytes) -> bool:
        """Do one bulk-out transfer; return False if the camera does not take it.

        The camera takes nothing while an answer waits to be read.
        """
        if BULK_OUT in self._halted:
            raise usb_errors.stalled()
        if self._in:
            return False
        try:
            container = self._out.feed(transfer)
            if container is not None:
                self._take(container)
        except MalformedContainerError:
            self._stall()
        return True

    def read(self, room: int) -> memoryview | None:
        """Return one bulk-in transfer of at most `room` bytes; None if there is nothing to read."""
        if BULK_IN in self._halted:
            raise usb_errors.stalled()
        return self._in.take(room) if self._in else None

    def interrupt_due_s(self) -> float:
        """Return the time at which the interrupt endpoint will have an event."""
        return self._clock.now() if self._interrupt else self._responder.event_due_s()

    def read_interrupt(self, room: int) -> memoryview:
        """Return one interrupt transfer, when one is due."""
        if not self._interrupt:
            event = self._responder.take_event()
            self._interrupt.put(
                encode_parameters(ContainerType.EVENT, event.code, _UNSOLICITED, event.params)
            )
        return self._interrupt.take(room)

    def request_out(self, request: int, data: bytes) -> None:
        """Do a class request from the host."""
        if request == RESET and not data:
            self.reset()
        elif request == CANCEL and len(data) == 6:
            self._cancel(*struct.unpack("<HI", data))
        else:
            raise usb_errors.stalled()

    def request_in(self, request: int) -> bytes:
        """Return the answer to a class request of the host."""
        if request != GET_STATUS:
            raise usb_errors.stalled()
        if self._halted:
            code = ResponseCode.TRANSACTION_CANCELLED
        elif self._clock.now() < self._cancelling_until_s:
            code = ResponseCode.DEVICE_BUSY
        else:
            code = ResponseCode.OK
        endpoints = sorted(self._halted)
        length = 4 + 4 * len(endpoints)
        return struct.pack(f"<HH{len(endpoints)}I", length, code, *endpoints)

    def _take(self, container: Container) -> None:
        if self._command is not None:
            self._finish(self._command, container)
        elif container.kind != ContainerType.COMMAND:
            raise MalformedContainerError
        else:
            self._begin(container)

    def _begin(self, command: Container) -> None:
        command.parameters()
        self._transaction_id = command.transaction_id
        if not self._responder.takes_data(command.code):
            self._execute(command, b"")
        elif self._stall_at == command.code:
            self._stall_at = None
            self._responder.abandon(command.transaction_id)
            self._stall()
        else:
            self._command = command

    def _finish(self, command: Container, data: Container) -> None:
        belongs = (ContainerType.DATA, command.code, command.transaction_id)
        if (data.kind, data.code, data.transaction_id) != belongs:
            self._responder.abandon(command.transaction_id)
            raise MalformedContainerError
        self._command = None
        self._execute(command, data.payload)

    def _execute(self, command: Container, data: bytes) -> None:
        code, transaction_id = command.code, command.transaction_id
        response = self._responder.transaction(code, transaction_id, command.parameters(), data)
        if code == self._swallow_at:
            self._swallow_at = None
            return
        if code == self._stall_at:
            self._stall_at = None
            self._stall()
            return
        if response.data is not None:
            self._in.put(encode(ContainerType.DATA, code, transaction_id, response.data))
        self._in.put(
            encode_parameters(
                ContainerType.RESPONSE, response.code, transaction_id, response.params
            )
        )

    def _cancel(self, code: int, transaction_id: int) -> None:
        if code != _CANCELLATION:
            raise usb_errors.stalled()
        if transaction_id == self._transaction_id:
            if self._command is not None:
                self._responder.abandon(transaction_id)
            self._discard_transaction()
            self._cancelling_until_s = self._clock.now() + CANCEL_S

    def _discard_transaction(self) -> None:
        self._command = None
        self._out.discard()
        self._in.discard()

    def _stall(self) -> None:
        self._discard_transaction()
        self._halted |= {BULK_IN, BULK_OUT}
