"""The USB side: containers over bulk endpoints, and the class requests that resynchronise them.

Source: USB still image capture device definition 1.0, sections 5.2 (class requests) and 7.1
(containers on bulk endpoints).
"""

import struct
from contextlib import suppress
from typing import Any

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..codes import DEVICE_BUSY, OK, response_text
from ..containers import HEADER_BYTES, Container, Kind, announced_length, decode, encode
from ..failures import MalformedError, NoAnswerError, StallError, shown
from .device import UsbDevice


class EventAssembler:
    """Assembler of packets, whether or not the camera ends a container with an empty one."""

    def __init__(self) -> None:
        self._received = bytearray()

    def discard(self) -> None:
        """Discard the beginning of an event that will not be finished."""
        self._received.clear()

    def feed(self, packet: bytes) -> Container | None:
        """Return the event of which `packet` is the end; None if it is not.

        Raises
        ------
        MalformedError
            The packets are no event; they are discarded.
        """
        self._received += packet
        if len(self._received) < HEADER_BYTES:
            return None
        received = bytes(self._received)
        try:
            length = announced_length(received)
            if len(received) < length:
                return None
            event = decode(received[:length])
            if event.kind is not Kind.EVENT:
                raise MalformedError(
                    "expected an event on the camera's interrupt endpoint", received
                )
        except MalformedError:
            self.discard()
            raise
        self.discard()
        return event


CANCEL, RESET, STATUS = 0x64, 0x66, 0x67
CANCEL_TRANSACTION = 0x4001
#: Length, code; parameters follow where the code has some.
STATUS_BYTES = 4

#: One read asks for at most this much; a whole number of packets at any speed.
BLOCK_BYTES = 256 * 1024
#: Time of silence after which a camera has nothing left to send.
SILENCE_S = 0.05
READY_TIMEOUT_S = 3.0
READY_PERIOD_S = 0.05
#: 256 MB of left-over data: more than any frame.
MAX_DRAINED_BLOCKS = 1024


class UsbLink:
    """Containers to and from one still image interface.

    Parameters
    ----------
    device
        The `usb.core.Device`.
    address
        Address of the device, for messages.
    clock
        Clock of the waiting for the device to become ready.

    Raises
    ------
    DeviceError
        The device has no still image interface, or another program holds it.
    """

    def __init__(self, device: Any, address: str, clock: Clock) -> None:
        self._name = f"camera {address}"
        self._clock = clock
        self._device = UsbDevice(device, address)
        self._events = EventAssembler()

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send one command, and its data if it has some.

        Raises
        ------
        DeviceError
            The device did not take it; `doing` is its purpose in the message.
        """
        self._write(encode(request), doing)
        if data is not None:
            outgoing = Container(Kind.DATA, request.code, request.transaction_id, data)
            self._write(encode(outgoing), doing)

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """Return one container of limited length, within `timeout_s` for each packet.

        Raises
        ------
        DeviceError
            Nothing came, it was cut short, it is longer than announced or than `at_most_bytes`.
        """
        return decode(self._read(doing, timeout_s, HEADER_BYTES + at_most_bytes))

    def event(self, timeout_s: float) -> Container | None:
        """Return the next event, None if the camera reports none within `timeout_s`.

        Raises
        ------
        DeviceError
            The packet is no event, or the camera cannot report any.
        """
        doing = "waiting for an event"
        if not self._device.has_events:
            raise DeviceError(
                f"{self._name}: {doing}: expected an interrupt endpoint on its PTP interface, "
                "found none: this camera cannot say when a frame is there"
            )
        deadline_s = self._clock.now() + timeout_s
        event, is_silent = None, True
        while event is None and (remaining_s := deadline_s - self._clock.now()) > 0:
            try:
                packet = self._device.read_event_packet(remaining_s, doing)
            except NoAnswerError:
                break
            except StallError:
                self._device.clear_event_halt()
                raise
            is_silent = False
            event = self._event_from(packet)
        if is_silent:
            self._events.discard()  # the rest of an event does not come so late
        return event

    def cancel(self, transaction_id: int) -> None:
        """Make the camera cancel `transaction_id` and discard its rest; wait until it is ready.

        Raises
        ------
        DeviceError
            The camera does not become ready.
        """
        request = struct.pack("<HI", CANCEL_TRANSACTION, transaction_id)
        self._device.request(CANCEL, request, "cancelling a transaction")
        self._drain()
        self._wait_until_ready()

    def reset(self) -> None:
        """Reset the camera's PTP side to its state when plugged in; its session is closed.

        Raises
        ------
        DeviceError
            The camera does not become ready.
        """
        self._device.request(RESET, b"", "resetting it")
        self._events.discard()
        self._clear_halts()
        self._drain()

    def close(self) -> None:
        """Release the interface; does not raise if the device is gone already."""
        self._device.close()

    def _write(self, data: bytes, doing: str) -> None:
        """Send one container; an empty packet ends it if nothing shorter does."""
        try:
            sent_bytes = self._device.write(data, doing)
            if sent_bytes == len(data) and len(data) % self._device.packet_bytes == 0:
                self._device.write(b"", doing)
        except StallError:
            self._clear_halts()
            raise
        if sent_bytes != len(data):
            raise DeviceError(
                f"{self._name}: {doing}: it took {sent_bytes} of {len(data)} bytes of {shown(data)}"
                ": unplug it and plug it in again"
            )

    def _read(self, doing: str, timeout_s: float, at_most_bytes: int) -> bytes:
        """Return one complete container."""
        packet_bytes = self._device.packet_bytes
        # The empty packet that ends a transfer of whole packets is still to be read, or never
        # came: cameras differ, so it is met at the head of the next one.
        packet = self._bulk_read(packet_bytes, timeout_s, doing) or self._bulk_read(
            packet_bytes, timeout_s, doing
        )
        length = announced_length(packet)
        if length > at_most_bytes:
            raise MalformedError(
                f"{self._name}: {doing}: expected at most {at_most_bytes} bytes, it announces "
                f"{length}",
                packet,
            )
        received = bytearray(packet)
        while len(received) < length and len(packet) > 0 and len(packet) % packet_bytes == 0:
            missing_packets = -((len(received) - length) // packet_bytes)
            size = min(missing_packets * packet_bytes, BLOCK_BYTES)
            try:
                packet = self._bulk_read(size, timeout_s, doing)
            except NoAnswerError as silence:
                raise NoAnswerError(
                    f"{silence}; of {length} bytes it sent {shown(bytes(received))}"
                ) from silence
            received += packet
        if len(received) != length:
            raise MalformedError(
                f"{self._name}: {doing}: expected {length} bytes as announced", bytes(received)
            )
        return bytes(received)

    def _bulk_read(self, size: int, timeout_s: float, doing: str) -> bytes:
        try:
            return self._device.read(size, timeout_s, doing)
        except StallError:
            self._clear_halts()
            raise

    def _event_from(self, packet: bytes) -> Container | None:
        """Return the event that `packet` completes; what follows no event is unreadable."""
        try:
            return self._events.feed(packet)
        except MalformedError:
            with suppress(NoAnswerError):
                for _ in range(MAX_DRAINED_BLOCKS):
                    self._device.read_event_packet(SILENCE_S, "discarding left-over events")
            raise

    def _drain(self) -> None:
        block = b""
        for _ in range(MAX_DRAINED_BLOCKS):
            try:
                block = self._bulk_read(BLOCK_BYTES, SILENCE_S, "discarding left-over data")
            except NoAnswerError:
                return
            except StallError:
                continue
        raise MalformedError(f"{self._name}: expected it to stop sending", block)

    def _clear_halts(self) -> None:
        self._device.clear_bulk_halts()
        self._wait_until_ready()

    def _wait_until_ready(self) -> None:
        deadline_s = self._clock.now() + READY_TIMEOUT_S
        while (code := self._status()) != OK:
            if self._clock.now() >= deadline_s:
                raise DeviceError(
                    f"{self._name}: expected status 0x2001 OK after giving up a transaction, it "
                    f"stays at {response_text(code)}: switch it off and on"
                )
            self._clock.sleep(READY_PERIOD_S)
            if code != DEVICE_BUSY:  # it wants halted endpoints cleared
                self._device.clear_bulk_halts()

    def _status(self) -> int:
        answer = self._device.ask(STATUS, "asking for its status")
        if len(answer) < STATUS_BYTES:
            raise MalformedError(
                f"{self._name}: expected a status of {STATUS_BYTES} bytes or more", answer
            )
        return int.from_bytes(answer[2:STATUS_BYTES], "little")
