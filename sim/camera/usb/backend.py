"""The simulated camera as pyusb sees it: an `IBackend` with one device, or none when unplugged."""

from types import SimpleNamespace
from typing import Any, NoReturn

from labrig.foundation.clock import VirtualClock

from ... import usb_errors
from ...usb_device import CONFIGURATION_VALUE, OneDeviceBackend, UsbHandle
from . import descriptors
from .cable import Cable
from .descriptors import UsbIdentity
from .still_image import BULK_IN, BULK_OUT, INTERRUPT_IN, StillImageFunction

#: Request type, GET_DESCRIPTOR, and its kind.
_GET_STRING = (0x80, 0x06, 3)
_FROM_INTERFACE, _TO_INTERFACE = 0xA1, 0x21
_INTERFACE = 0


class CameraBackend(OneDeviceBackend):
    """Bus with this one camera on it.

    Every transfer takes virtual time; a time-out passes in full. A time-out of 0, for ever with
    libusb, ends at once here: nothing else advances this clock meanwhile.

    Parameters
    ----------
    clock
        The simulated room's clock.
    function
        The camera's endpoints.
    cable
        Cable, which costs time and can be pulled.
    identity
        Identity of the camera on the bus.
    """

    def __init__(
        self,
        clock: VirtualClock,
        function: StillImageFunction,
        cable: Cable,
        identity: UsbIdentity,
    ) -> None:
        self._identity = identity
        self._clock = clock
        self._function = function
        self._cable = cable
        self._claimed_by: UsbHandle | None = None
        super().__init__()

    def close_all(self) -> None:
        """Close all handles, as an operating system does for a killed process."""
        super().close_all()
        self._claimed_by = None

    def get_device_descriptor(self, dev: Any) -> SimpleNamespace:
        """Return the device descriptor."""
        return descriptors.device(dev, self._identity)

    def get_configuration_descriptor(self, dev: Any, config: int) -> SimpleNamespace:
        """Return the one configuration; IndexError ends pyusb's walk."""
        return (descriptors.configuration(),)[config]

    def get_interface_descriptor(
        self, dev: Any, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        """Return the one interface with its one setting; IndexError ends pyusb's walk."""
        return (((descriptors.interface(),),),)[config][intf][alt]

    def get_endpoint_descriptor(
        self, dev: Any, ep: int, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        """Return the endpoint by its place in the interface."""
        return descriptors.endpoints()[ep]

    def close_device(self, dev_handle: UsbHandle) -> None:
        """Close the handle, also of a device that has been unplugged."""
        super().close_device(dev_handle)
        if self._claimed_by is dev_handle:
            self._claimed_by = None

    def set_configuration(self, dev_handle: UsbHandle, config_value: int) -> None:
        """Do nothing: there is one configuration."""
        self._use(dev_handle)
        if config_value != CONFIGURATION_VALUE:
            raise usb_errors.not_found()

    def set_interface_altsetting(self, dev_handle: UsbHandle, intf: int, altsetting: int) -> None:
        """Do nothing: there is one setting."""
        self._use(dev_handle)
        if (intf, altsetting) != (_INTERFACE, 0):
            raise usb_errors.not_found()

    def claim_interface(self, dev_handle: UsbHandle, intf: int) -> None:
        """Claim the interface, for one handle at a time."""
        self._use(dev_handle)
        if intf != _INTERFACE:
            raise usb_errors.not_found()
        if self._claimed_by not in (None, dev_handle):
            raise usb_errors.claimed_by_another()
        self._claimed_by = dev_handle

    def release_interface(self, dev_handle: UsbHandle, intf: int) -> None:
        """Release the interface."""
        self._use(dev_handle)
        if intf != _INTERFACE or self._claimed_by is not dev_handle:
            raise usb_errors.not_found()
        self._claimed_by = None

    def bulk_write(self, dev_handle: UsbHandle, ep: int, intf: int, data: Any, timeout: int) -> int:
        """Do one bulk-out transfer."""
        self._use(dev_handle)
        if ep != BULK_OUT:
            raise usb_errors.not_found()
        transfer = data.tobytes()
        self._cable.carry(len(transfer))
        if not self._function.write(transfer):
            self._time_out(timeout)
        return len(transfer)

    def bulk_read(self, dev_handle: UsbHandle, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """Do one bulk-in transfer."""
        self._use(dev_handle)
        if ep != BULK_IN:
            raise usb_errors.not_found()
        target = memoryview(buff).cast("B")
        transfer = self._function.read(len(target))
        if transfer is None:
            self._time_out(timeout)
        return self._deliver(transfer, target)

    def intr_read(self, dev_handle: UsbHandle, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """Do one interrupt transfer, as soon as the camera has an event."""
        self._use(dev_handle)
        if ep != INTERRUPT_IN:
            raise usb_errors.not_found()
        wait_s = self._function.interrupt_due_s() - self._clock.now()
        if wait_s > timeout / 1000:
            self._time_out(timeout)
        self._cable.wait(max(wait_s, 0.0))
        target = memoryview(buff).cast("B")
        return self._deliver(self._function.read_interrupt(len(target)), target)

    def ctrl_transfer(
        self,
        dev_handle: UsbHandle,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: Any,
        timeout: int,
    ) -> int:
        """Answer string descriptors and the class requests; anything else stalls, for this once."""
        self._use(dev_handle)
        if bmRequestType == _TO_INTERFACE:
            content = data.tobytes()
            self._cable.carry(0)
            self._function.request_out(bRequest, content)
            return len(content)
        if bmRequestType == _FROM_INTERFACE:
            answer = self._function.request_in(bRequest)
        elif (bmRequestType, bRequest, wValue >> 8) == _GET_STRING:
            answer = descriptors.string(wValue & 0xFF, self._identity)
        else:
            raise usb_errors.stalled()
        target = memoryview(data).cast("B")
        n_bytes = min(len(answer), len(target))
        target[:n_bytes] = answer[:n_bytes]
        self._cable.carry(0)
        return n_bytes

    def clear_halt(self, dev_handle: UsbHandle, ep: int) -> None:
        """Clear the halt of one endpoint."""
        self._use(dev_handle)
        self._cable.carry(0)
        self._function.clear_halt(ep)

    def reset_device(self, dev_handle: UsbHandle) -> None:
        """Reset the port: the camera forgets its session, the handle stays good."""
        self._use(dev_handle)
        self._cable.carry(0)
        self._function.reset()

    @property
    def _is_plugged(self) -> bool:
        return self._cable.is_plugged

    @property
    def _plugging(self) -> int:
        return self._cable.plugging

    def _power_lost(self) -> None:
        self._function.reset()

    def _deliver(self, transfer: memoryview, target: memoryview) -> int:
        self._cable.carry(len(transfer))
        target[: len(transfer)] = transfer
        return len(transfer)

    def _time_out(self, timeout: int) -> NoReturn:
        self._cable.wait(timeout / 1000)
        raise usb_errors.timed_out()
