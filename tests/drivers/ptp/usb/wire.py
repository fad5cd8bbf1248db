"""A USB bus with one still image device on it: packets, halts, unplugging, under pyusb itself."""

import errno
from array import array
from collections import deque
from types import SimpleNamespace
from typing import Any, NoReturn, Protocol

import usb.backend
import usb.core

from labrig.acquire.connections import SerialPort
from labrig.foundation.clock import VirtualClock

PACKET, INTERRUPT_PACKET = 512, 8
BULK_IN, BULK_OUT, INTERRUPT_IN = 0x81, 0x02, 0x83
TRANSACTION_S = 0.0005
#: Far more than any test needs: a driver that gets here hangs.
MAX_TRANSFERS = 200_000


class Peer(Protocol):
    """The device's side."""

    def written(self, wire: "Wire", data: bytes) -> None:
        """One bulk transfer from the host has ended."""

    def control(self, wire: "Wire", request: int, data: bytes) -> bytes:
        """A class request; for one that reads, the answer."""


class StillImageDevice(usb.backend.IBackend):  # type: ignore[misc]
    """What pyusb asks of a bus with one still image device on it when it opens that."""

    def enumerate_devices(self) -> list[int]:
        return [1]

    def get_device_descriptor(self, device: Any) -> SimpleNamespace:
        return SimpleNamespace(
            bLength=18, bDescriptorType=1, bcdUSB=0x0200, bDeviceClass=0, bDeviceSubClass=0,
            bDeviceProtocol=0, bMaxPacketSize0=64, idVendor=0x04A9, idProduct=0x3199,
            bcdDevice=2, iManufacturer=0, iProduct=0, iSerialNumber=0, bNumConfigurations=1,
            address=5, bus=1, port_number=1, port_numbers=(1,), speed=3,
        )  # fmt: skip

    def get_configuration_descriptor(self, device: Any, config: int) -> SimpleNamespace:
        if config != 0:
            raise IndexError
        return SimpleNamespace(
            bLength=9, bDescriptorType=2, wTotalLength=39, bNumInterfaces=1,
            bConfigurationValue=1, iConfiguration=0, bmAttributes=0xC0, bMaxPower=1,
            extra_descriptors=[],
        )  # fmt: skip

    def get_interface_descriptor(
        self, device: Any, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        if (intf, alt, config) != (0, 0, 0):
            raise IndexError
        return SimpleNamespace(
            bLength=9, bDescriptorType=4, bInterfaceNumber=0, bAlternateSetting=0,
            bNumEndpoints=3, bInterfaceClass=6, bInterfaceSubClass=1, bInterfaceProtocol=1,
            iInterface=0, extra_descriptors=[],
        )  # fmt: skip

    def get_endpoint_descriptor(
        self, device: Any, ep: int, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        interrupt = (INTERRUPT_IN, 3, INTERRUPT_PACKET)
        kinds = (interrupt, (BULK_IN, 2, PACKET), (BULK_OUT, 2, PACKET))
        address, kind, size = kinds[ep]
        return SimpleNamespace(
            bLength=7, bDescriptorType=5, bEndpointAddress=address, bmAttributes=kind,
            wMaxPacketSize=size, bInterval=0, bRefresh=0, bSynchAddress=0, extra_descriptors=[],
        )  # fmt: skip

    def open_device(self, device: Any) -> int:
        return 1

    def close_device(self, handle: Any) -> None:
        pass

    def get_configuration(self, handle: Any) -> int:
        return 1

    def claim_interface(self, handle: Any, intf: int) -> None:
        pass

    def release_interface(self, handle: Any, intf: int) -> None:
        pass


class Wire(StillImageDevice):
    """pyusb backend; lets the virtual clock pass as a bus would."""

    def __init__(self, peer: Peer, clock: VirtualClock) -> None:
        super().__init__()
        self.peer = peer
        self.clock = clock
        self.to_host: deque[bytes] = deque()
        self.interrupts: deque[bytes] = deque()
        self.interrupt_is_halted = False
        self.sends_empty_packets = True
        self.halted = False
        self.unplugged = False
        self.claimed = False
        self.claim_errno: int | None = None
        self.transfers = 0
        self._from_host = b""

    def send(self, transfer: bytes) -> None:
        """Queue a bulk transfer to the host, in packets."""
        packets = [transfer[i : i + PACKET] for i in range(0, len(transfer), PACKET)]
        if len(transfer) % PACKET == 0 and self.sends_empty_packets:
            packets.append(b"")
        self.to_host.extend(packets)

    def bulk_write(self, handle: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
        self._check(ep, BULK_OUT)
        self._from_host += bytes(data)
        if len(data) % PACKET or not data:
            transfer, self._from_host = self._from_host, b""
            self.peer.written(self, transfer)
        return len(data)

    def bulk_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        self._check(ep, BULK_IN)
        assert len(buff) % PACKET == 0, "a transfer could overflow this buffer"
        received = b""
        while len(received) < len(buff) and self.to_host:
            packet = self.to_host.popleft()
            received += packet
            if len(packet) < PACKET:
                break
        else:
            if not received:
                self.clock.spend(timeout / 1e3)
                raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
        buff[: len(received)] = array("B", received)
        return len(received)

    def intr_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        self._check(ep, INTERRUPT_IN)
        assert len(buff) == INTERRUPT_PACKET, "a longer read would wait for one more packet"
        if self.interrupt_is_halted:
            raise usb.core.USBError("Pipe error", -9, errno.EPIPE)
        if not self.interrupts:
            self.clock.spend(timeout / 1e3)
            raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
        packet = self.interrupts.popleft()
        buff[: len(packet)] = array("B", packet)
        return len(packet)

    def ctrl_transfer(
        self, handle: Any, kind: int, request: int, value: int, index: int, data: Any, timeout: int
    ) -> int:
        self._check(0, 0)
        assert (value, index) == (0, 0)
        if kind == 0x21:
            self.peer.control(self, request, bytes(data))
            return len(data)
        assert kind == 0xA1
        answer = self.peer.control(self, request, b"")
        data[: len(answer)] = array("B", answer)
        return len(answer)

    def clear_halt(self, handle: Any, ep: int) -> None:
        if self.unplugged:
            raise usb.core.USBError("No such device", -4, errno.ENODEV)
        if ep == INTERRUPT_IN:
            self.interrupt_is_halted = False
            return
        assert ep in (BULK_IN, BULK_OUT)
        self.halted = False

    def _check(self, ep: int, expected: int) -> None:
        assert ep == expected
        assert self.claimed
        self.transfers += 1
        assert self.transfers < MAX_TRANSFERS, "the driver hangs"
        self.clock.spend(TRANSACTION_S)
        if self.unplugged:
            raise usb.core.USBError("No such device", -4, errno.ENODEV)
        if self.halted and ep != 0:
            raise usb.core.USBError("Pipe error", -9, errno.EPIPE)

    def claim_interface(self, handle: Any, intf: int) -> None:
        if self.claim_errno is not None:
            raise usb.core.USBError("claim failed", None, self.claim_errno)
        self.claimed = True

    def release_interface(self, handle: Any, intf: int) -> None:
        self.claimed = False


class OneDevice:
    """Connections to that device alone."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._device = usb.core.Device(1, wire)

    @property
    def clock(self) -> VirtualClock:
        return self._wire.clock

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        raise AssertionError("a camera has no serial port")

    def usb(self, address: str, serial_of: object = None) -> Any:
        return self._device

    def tcp(self, address: str, default_port: int) -> NoReturn:
        raise AssertionError("this camera is on USB")
