"""libgphoto2's own virtual camera as a device on a USB bus, for one process.

The library's `vusb` is a camera behind raw pipes: it keeps no transfers apart. Its state is global
and its session cannot be opened twice, so whoever uses it does so in a process of its own.
"""

import ctypes
import errno
import importlib.util
import os
import struct
from array import array
from collections import deque
from pathlib import Path
from typing import Any

import usb.core

from tests.drivers.ptp.usb.wire import BULK_IN, BULK_OUT, INTERRUPT_IN, PACKET, StillImageDevice

STATUS, STATUS_OK = 0x67, bytes((4, 0, 0x01, 0x20))
GP_ERROR_TIMEOUT = -10
MAX_BYTES = 1 << 16


class VirtualCamera:
    """The library's port functions on its virtual camera, whose card is the folder `pictures`."""

    def __init__(self, pictures: Path) -> None:
        found = importlib.util.find_spec("gphoto2")
        assert found is not None
        assert found.origin is not None
        folder = Path(found.origin).parent / "libgphoto2"
        os.environ |= {"VCAMERADIR": str(pictures), "IOLIBS": str(folder / "vusb")}
        self._library = ctypes.CDLL(str(folder / "libgphoto2_port.so.12"))
        ports, info, self._port = (ctypes.c_void_p() for _ in range(3))
        self._do("info_list_new", ctypes.byref(ports))
        self._do("info_list_load", ports)
        self._do("info_list_get_info", ports, 0, ctypes.byref(info))
        self._do("new", ctypes.byref(self._port))
        self._do("set_info", self._port, info)
        self._do("open", self._port)

    def write(self, data: bytes) -> None:
        assert self._do("write", self._port, data, len(data)) == len(data)

    def read(self) -> bytes:
        """All that the camera has to say on its bulk pipe."""
        buffer, received = ctypes.create_string_buffer(MAX_BYTES), b""
        while count := self._do("read", self._port, buffer, MAX_BYTES):
            received += buffer.raw[:count]
        return received

    def read_interrupt(self, timeout_ms: int) -> bytes | None:
        buffer = ctypes.create_string_buffer(PACKET)
        self._do("set_timeout", self._port, timeout_ms)
        count = self._library.gp_port_check_int(self._port, buffer, PACKET)
        assert count > 0 or count == GP_ERROR_TIMEOUT
        return buffer.raw[:count] if count > 0 else None

    def _do(self, name: str, *arguments: Any) -> int:
        result: int = getattr(self._library, f"gp_port_{name}")(*arguments)
        assert result >= 0, f"gp_port_{name} answers {result}"
        return result


class VirtualBus(StillImageDevice):
    """pyusb backend with the virtual camera on it: cuts its pipes into transfers and packets."""

    def __init__(self, camera: VirtualCamera) -> None:
        super().__init__()
        self._camera = camera
        self._to_host: deque[bytes] = deque()
        self._events: deque[bytes] = deque()

    def bulk_write(self, handle: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
        assert ep == BULK_OUT
        if data:
            self._camera.write(bytes(data))
            self._take(self._camera.read())
        return len(data)

    def bulk_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        assert ep == BULK_IN
        return self._give(self._to_host, buff)

    def intr_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        assert ep == INTERRUPT_IN
        if not self._events and (event := self._camera.read_interrupt(timeout)) is not None:
            self._events.append(event)
        return self._give(self._events, buff)

    def ctrl_transfer(
        self, handle: Any, kind: int, request: int, value: int, index: int, data: Any, timeout: int
    ) -> int:
        if request != STATUS:
            self._to_host.clear()
            return len(data)
        data[: len(STATUS_OK)] = array("B", STATUS_OK)
        return len(STATUS_OK)

    def _take(self, stream: bytes) -> None:
        """Containers are transfers of their own; one of whole packets ends with an empty one."""
        while stream:
            (length,) = struct.unpack_from("<I", stream)
            self._to_host.append(stream[:length])
            if length % PACKET == 0:
                self._to_host.append(b"")
            stream = stream[length:]

    def _give(self, transfers: deque[bytes], buff: Any) -> int:
        if not transfers:
            raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
        transfer = transfers.popleft()
        if len(transfer) > len(buff):
            transfers.appendleft(transfer[len(buff) :])
        given = transfer[: len(buff)]
        buff[: len(given)] = array("B", given)
        return len(given)
