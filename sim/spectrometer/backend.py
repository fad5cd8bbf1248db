"""The simulated spectrometer as pyusb sees it: an `IBackend` with one device, or none."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from labrig.foundation.clock import VirtualClock

from .. import usb_errors
from ..camera.usb.cable import BYTES_PER_S, TRANSACTION_S
from ..faults import FaultTime
from ..usb_device import CONFIGURATION_VALUE, OneDeviceBackend, UsbHandle
from .instrument import ANSWERS, COMMANDS, SPECTRA, UsbSpectrometer

VENDOR, PRODUCT = 0x2457, 0x101E
#: Endpoints in the order of the descriptor; the second of spectra is used by other models.
ENDPOINTS = (COMMANDS, ANSWERS, SPECTRA, 0x86)
PACKET = 512
#: Bytes of a transfer that was cut off.
CUT_OFF = 512


class SpectrometerBackend(OneDeviceBackend):
    """Bus with this one spectrometer on it; every transfer takes virtual time.

    Parameters
    ----------
    clock
        The room's clock.
    instrument
        Instrument behind the endpoints.
    unplugged
        Times at which the cable is out.
    silent
        Times at which the instrument does not answer.
    truncated
        Times at which transfers of spectra end too early.
    """

    def __init__(
        self,
        clock: VirtualClock,
        instrument: UsbSpectrometer,
        *,
        unplugged: Sequence[FaultTime] = (),
        silent: Sequence[FaultTime] = (),
        truncated: Sequence[FaultTime] = (),
    ) -> None:
        self._clock = clock
        self._instrument = instrument
        self._unplugged = unplugged
        self._silent = silent
        self._truncated = truncated
        super().__init__()

    def get_device_descriptor(self, dev: Any) -> SimpleNamespace:
        """Return the device descriptor; its serial number is in the EEPROM only."""
        return SimpleNamespace(
            bLength=18, bDescriptorType=1, bcdUSB=0x0200, bDeviceClass=0, bDeviceSubClass=0,
            bDeviceProtocol=0, bMaxPacketSize0=64, idVendor=VENDOR, idProduct=PRODUCT,
            bcdDevice=0x0002, iManufacturer=0, iProduct=0, iSerialNumber=0, bNumConfigurations=1,
            address=dev, bus=1, port_number=2, port_numbers=(2,), speed=3,
        )  # fmt: skip

    def get_configuration_descriptor(self, dev: Any, config: int) -> SimpleNamespace:
        """Return the one configuration; IndexError ends pyusb's walk."""
        return (
            SimpleNamespace(
                bLength=9, bDescriptorType=2, wTotalLength=46, bNumInterfaces=1,
                bConfigurationValue=CONFIGURATION_VALUE, iConfiguration=0, bmAttributes=0x80,
                bMaxPower=125, extra_descriptors=b"",
            ),
        )[config]  # fmt: skip

    def get_interface_descriptor(
        self, dev: Any, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        """Return the one interface, of the vendor's own class; IndexError ends pyusb's walk."""
        interface = SimpleNamespace(
            bLength=9, bDescriptorType=4, bInterfaceNumber=0, bAlternateSetting=0,
            bNumEndpoints=len(ENDPOINTS), bInterfaceClass=0xFF, bInterfaceSubClass=0,
            bInterfaceProtocol=0, iInterface=0, extra_descriptors=b"",
        )  # fmt: skip
        return (((interface,),),)[config][intf][alt]

    def get_endpoint_descriptor(
        self, dev: Any, ep: int, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        """Return a bulk endpoint by its place in the interface."""
        return SimpleNamespace(
            bLength=7, bDescriptorType=5, bEndpointAddress=ENDPOINTS[ep], bmAttributes=2,
            wMaxPacketSize=PACKET, bInterval=0, bRefresh=0, bSynchAddress=0, extra_descriptors=b"",
        )  # fmt: skip

    def set_configuration(self, dev_handle: UsbHandle, config_value: int) -> None:
        """Do nothing: there is one configuration."""
        self._use(dev_handle)

    def claim_interface(self, dev_handle: UsbHandle, intf: int) -> None:
        """Do nothing: nobody else is there."""
        self._use(dev_handle)

    def release_interface(self, dev_handle: UsbHandle, intf: int) -> None:
        """Do nothing: nobody else is there."""

    def bulk_write(self, dev_handle: UsbHandle, ep: int, intf: int, data: Any, timeout: int) -> int:
        """Do one bulk-out transfer."""
        self._use(dev_handle)
        if ep != COMMANDS:
            raise usb_errors.not_found()
        command = data.tobytes()
        self._carry(len(command))
        if not self._is_any_on(self._silent):
            self._instrument.write(command)
        return len(command)

    def bulk_read(self, dev_handle: UsbHandle, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """Do one bulk-in transfer, as soon as there is something to read.

        A time-out passes in full; the answer to an earlier command may still come then.
        """
        self._use(dev_handle)
        if ep not in (ANSWERS, SPECTRA):
            raise usb_errors.not_found()
        wait_s = self._instrument.due_s(ep) - self._clock.now()
        if wait_s > timeout / 1000 or self._is_any_on(self._silent):
            self._pass(timeout / 1000)
            raise usb_errors.timed_out()
        self._pass(max(wait_s, 0.0))
        transfer = self._instrument.read(ep)
        if ep == SPECTRA and self._is_any_on(self._truncated):
            transfer = transfer[:CUT_OFF]
        target = memoryview(buff).cast("B")
        if len(transfer) > len(target):
            raise usb_errors.overflowed()
        self._carry(len(transfer))
        target[: len(transfer)] = transfer
        return len(transfer)

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
        """Stall: it has no strings and no requests of its own."""
        self._use(dev_handle)
        raise usb_errors.stalled()

    def reset_device(self, dev_handle: UsbHandle) -> None:
        """Reset the port: the instrument forgets what was asked."""
        self._use(dev_handle)
        self._instrument.reset()

    @property
    def _is_plugged(self) -> bool:
        return not self._is_any_on(self._unplugged)

    @property
    def _plugging(self) -> int:
        now_s = self._clock.now()
        return 1 + sum(out.at <= now_s for out in self._unplugged)

    def _power_lost(self) -> None:
        self._instrument.reset()

    def _carry(self, n_bytes: int) -> None:
        self._pass(TRANSACTION_S + n_bytes / BYTES_PER_S)

    def _pass(self, duration_s: float) -> None:
        """Let time pass; the cable may come out meanwhile."""
        now_s = self._clock.now()
        out_s = [out.at - now_s for out in self._unplugged if 0 < out.at - now_s <= duration_s]
        self._clock.spend(min(out_s, default=duration_s))
        if out_s:
            self._notice_unplugging()
            raise usb_errors.unplugged()

    def _is_any_on(self, spans: Sequence[FaultTime]) -> bool:
        now_s = self._clock.now()
        return any(span.is_on(now_s) for span in spans)
