"""The USB side: bulk transfers and class requests of a still image device, through pyusb.

Source: USB still image capture device definition 1.0, sections 5.2 (class requests) and 7.1
(containers on bulk endpoints). pyusb carries no types, so `Any` ends here.
"""

import errno
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import usb.core
import usb.util

from labrig.clock import Clock
from labrig.errors import DeviceError

from .containers import HEADER_BYTES, Container, Kind, announced_length, decode, encode
from .failures import MalformedError, NoAnswerError, StallError, UnpluggedError
from .ptp_codes import DEVICE_BUSY, OK, response_text
from .usb_errors import WAKE_UP, usb_errors_explained
from .usb_events import EventAssembler
from .usb_interface import claim_still_image

CANCEL, RESET, STATUS = 0x64, 0x66, 0x67
HOST_TO_INTERFACE, INTERFACE_TO_HOST = 0x21, 0xA1
CANCEL_TRANSACTION = 0x4001

#: One read asks for at most this much; a whole number of packets at any speed.
BLOCK_BYTES = 256 * 1024
CONTROL_TIMEOUT_S = 2.0
WRITE_TIMEOUT_S = 5.0
#: A camera that has been silent for so long has nothing left to say.
SILENCE_S = 0.05
READY_TIMEOUT_S = 3.0
READY_PERIOD_S = 0.05
#: 256 MB of left-over data: more than any frame.
MOST_DRAINED_BLOCKS = 1024


class UsbLink:
    """Containers to and from one still image interface.

    Parameters
    ----------
    device
        The `usb.core.Device`.
    address
        What messages call it.
    clock
        On which it waits for the device to become ready.

    Raises
    ------
    DeviceError
        No still image interface, or another program holds it.
    """

    def __init__(self, device: Any, address: str, clock: Clock) -> None:
        self._device = device
        self._address = address
        self._clock = clock
        self._is_gone = False
        with self._named("opening its PTP interface"):
            endpoints = claim_still_image(device, address)
        self._interface = endpoints.interface
        self._in = endpoints.bulk_in
        self._out = endpoints.bulk_out
        self._packet_bytes = endpoints.packet_bytes
        self._interrupt = endpoints.interrupt_in
        self._event_packet_bytes = endpoints.event_packet_bytes
        self._events = EventAssembler()

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send one command, and its data if it has some.

        Raises
        ------
        DeviceError
            It was not taken; `doing` says what for.
        """
        self._write(encode(request), doing)
        if data is not None:
            outgoing = Container(Kind.DATA, request.code, request.transaction_id, data)
            self._write(encode(outgoing), doing)

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """One container with at most so much in it, within `timeout_s` a packet.

        Raises
        ------
        DeviceError
            Nothing came, it was cut short, it is longer than it says or than `at_most_bytes`.
        """
        return decode(self._read(doing, timeout_s, HEADER_BYTES + at_most_bytes))

    def event(self, timeout_s: float) -> Container | None:
        """The next event, None if the camera reports none within `timeout_s`.

        Raises
        ------
        DeviceError
            What came is no event, or the camera cannot report any.
        """
        doing = "waiting for an event"
        if self._interrupt is None:
            raise DeviceError(
                f"camera {self._address}: {doing}: expected an interrupt endpoint on its PTP "
                "interface, found none: this camera cannot say when a frame is there"
            )
        deadline_s = self._clock.now() + timeout_s
        event, is_silent = None, True
        # packet by packet: a longer read would go on to wait where a full packet is the last one
        while event is None and (left_s := deadline_s - self._clock.now()) > 0:
            try:
                with self._named(doing):
                    packet = self._device.read(
                        self._interrupt, self._event_packet_bytes, _ms(left_s)
                    )
            except NoAnswerError:
                break
            except StallError:
                with self._named("clearing a halted endpoint"):
                    self._device.clear_halt(self._interrupt)
                raise
            is_silent = False
            event = self._event_from(bytes(packet))
        if is_silent:
            self._events.discard()  # the rest of an event does not come so late
        return event

    def cancel(self, transaction_id: int) -> None:
        """Have the camera give up `transaction_id`, forget what it still sends, wait until ready.

        Raises
        ------
        DeviceError
            The camera does not become ready.
        """
        request = struct.pack("<HI", CANCEL_TRANSACTION, transaction_id)
        with self._named("cancelling a transaction"):
            self._control_out(CANCEL, request)
        self._drain()
        self._wait_until_ready()

    def reset(self) -> None:
        """Put the camera's PTP side back to where it was when plugged in; its session is closed.

        Raises
        ------
        DeviceError
            The camera does not become ready.
        """
        with self._named("resetting it"):
            self._control_out(RESET, b"")
        self._events.discard()
        self._clear_halts()
        self._drain()

    def close(self) -> None:
        """Release the interface; says nothing if the device is gone already."""
        with suppress(usb.core.USBError, NotImplementedError):
            usb.util.dispose_resources(self._device)

    def _write(self, data: bytes, doing: str) -> None:
        """Send one container; an empty packet ends it if nothing shorter does."""
        try:
            with self._named(doing):
                sent = self._device.write(self._out, data, _ms(WRITE_TIMEOUT_S))
                if sent == len(data) and len(data) % self._packet_bytes == 0:
                    self._device.write(self._out, b"", _ms(WRITE_TIMEOUT_S))
        except StallError:
            self._clear_halts()
            raise
        if sent != len(data):
            raise MalformedError(
                f"camera {self._address}: {doing}: it took {sent} of {len(data)} bytes: "
                "unplug it and plug it in again"
            )

    def _read(self, doing: str, timeout_s: float, at_most_bytes: int) -> bytes:
        """One container, whole."""
        # The empty packet that ends a transfer of whole packets is still to be read, or never
        # came: cameras differ, so it is met at the head of the next one.
        packet = self._bulk_read(self._packet_bytes, doing, timeout_s) or self._bulk_read(
            self._packet_bytes, doing, timeout_s
        )
        length = announced_length(packet)
        if length > at_most_bytes:
            raise MalformedError(
                f"camera {self._address}: {doing}: expected at most {at_most_bytes} bytes, "
                f"it announces {length}"
            )
        received = bytearray(packet)
        while len(received) < length and len(packet) > 0 and len(packet) % self._packet_bytes == 0:
            missing_packets = -((len(received) - length) // self._packet_bytes)
            size = min(missing_packets * self._packet_bytes, BLOCK_BYTES)
            packet = self._bulk_read(size, doing, timeout_s)
            received += packet
        if len(received) != length:
            raise MalformedError(
                f"camera {self._address}: {doing}: expected {length} bytes as announced, "
                f"it sent {len(received)}"
            )
        return bytes(received)

    def _bulk_read(self, size: int, doing: str, timeout_s: float) -> bytes:
        try:
            with self._named(f"{doing} within {timeout_s:g} s"):
                return bytes(self._device.read(self._in, size, _ms(timeout_s)))
        except StallError:
            self._clear_halts()
            raise

    def _event_from(self, packet: bytes) -> Container | None:
        """The event that `packet` completes; behind what is none, nothing can be understood."""
        try:
            return self._events.feed(packet)
        except MalformedError:
            with suppress(NoAnswerError), self._named("discarding left-over events"):
                for _ in range(MOST_DRAINED_BLOCKS):
                    self._device.read(self._interrupt, self._event_packet_bytes, _ms(SILENCE_S))
            raise

    def _drain(self) -> None:
        for _ in range(MOST_DRAINED_BLOCKS):
            try:
                self._bulk_read(BLOCK_BYTES, "discarding left-over data", SILENCE_S)
            except NoAnswerError:
                return
            except StallError:
                continue
        raise MalformedError(
            f"camera {self._address}: it does not stop sending: switch it off and on"
        )

    def _clear_halts(self) -> None:
        self._clear_both()
        self._wait_until_ready()

    def _clear_both(self) -> None:
        with self._named("clearing a halted endpoint"):
            for endpoint in (self._in, self._out):
                self._device.clear_halt(endpoint)

    def _wait_until_ready(self) -> None:
        deadline_s = self._clock.now() + READY_TIMEOUT_S
        while (code := self._status()) != OK:
            if self._clock.now() >= deadline_s:
                raise DeviceError(
                    f"camera {self._address}: expected status 0x2001 OK after giving up a "
                    f"transaction, it stays at {response_text(code)}: switch it off and on"
                )
            self._clock.sleep(READY_PERIOD_S)
            if code != DEVICE_BUSY:  # it wants halted endpoints cleared
                self._clear_both()

    def _status(self) -> int:
        with self._named("asking for its status"):
            answer = bytes(
                self._device.ctrl_transfer(
                    INTERFACE_TO_HOST, STATUS, 0, self._interface, 32, _ms(CONTROL_TIMEOUT_S)
                )
            )
        if len(answer) < 4:
            raise MalformedError(
                f"camera {self._address}: expected a status of 4 bytes, got '{answer.hex(' ')}'"
            )
        return int.from_bytes(answer[2:4], "little")

    def _control_out(self, request: int, data: bytes) -> None:
        self._device.ctrl_transfer(
            HOST_TO_INTERFACE, request, 0, self._interface, data, _ms(CONTROL_TIMEOUT_S)
        )

    @contextmanager
    def _named(self, doing: str) -> Iterator[None]:
        """Name what pyusb could not do; a camera that is gone stays so."""
        context = f"camera {self._address}: {doing}"
        if self._is_gone:
            raise UnpluggedError(f"{context}: it is gone: {WAKE_UP}")
        with usb_errors_explained(context):
            try:
                yield
            except usb.core.USBError as failure:
                self._is_gone = failure.errno == errno.ENODEV
                raise


def _ms(duration_s: float) -> int:
    return max(1, round(duration_s * 1e3))
