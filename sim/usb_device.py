"""A bus with one simulated USB device on it, as pyusb sees it: its handles, and unplugging."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import usb.backend

from . import usb_errors

#: The one configuration of a simulated device.
CONFIGURATION_VALUE = 1


class UsbHandle:
    """One opening of the device, valid until it is closed or the cable comes out."""


class OneDeviceBackend(usb.backend.IBackend):  # type: ignore[misc]  # pyusb is untyped
    """Bus with one device, or none while it is unplugged; a device that returns is a new one."""

    def __init__(self) -> None:
        super().__init__()
        self._seen_plugging = self._plugging
        self._handles: set[UsbHandle] = set()

    @property
    @abstractmethod
    def _is_plugged(self) -> bool:
        """Whether the device is on the bus now."""

    @property
    @abstractmethod
    def _plugging(self) -> int:
        """Number of times that it was plugged in: its address on the bus."""

    @abstractmethod
    def _power_lost(self) -> None:
        """Reset the device, which was unplugged."""

    def close_all(self) -> None:
        """Close all handles, as an operating system does for a killed process."""
        self._handles.clear()

    def enumerate_devices(self) -> Iterator[int]:
        """Yield the device by its address on the bus, if it is plugged in."""
        self._notice_unplugging()
        if self._is_plugged:
            yield self._plugging

    def get_parent(self, dev: Any) -> None:
        """Return None: no hub is simulated."""

    def open_device(self, dev: int) -> UsbHandle:
        """Open the device, unless it has gone or come back under another address."""
        self._notice_unplugging()
        if dev != self._plugging or not self._is_plugged:
            raise usb_errors.unplugged()
        handle = UsbHandle()
        self._handles.add(handle)
        return handle

    def close_device(self, dev_handle: UsbHandle) -> None:
        """Close the handle, also of a device that has been unplugged."""
        self._handles.discard(dev_handle)

    def get_configuration(self, dev_handle: UsbHandle) -> int:
        """Return the one configuration, which is always the active one."""
        self._use(dev_handle)
        return CONFIGURATION_VALUE

    def is_kernel_driver_active(self, dev_handle: UsbHandle, intf: int) -> bool:
        """Return False: no desktop and no driver of the system has taken it."""
        self._use(dev_handle)
        return False

    def _use(self, handle: UsbHandle) -> None:
        self._notice_unplugging()
        if handle not in self._handles or not self._is_plugged:
            raise usb_errors.unplugged()

    def _notice_unplugging(self) -> None:
        if self._seen_plugging != self._plugging:
            self._seen_plugging = self._plugging
            self.close_all()
            self._power_lost()
