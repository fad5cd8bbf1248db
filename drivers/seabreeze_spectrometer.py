"""Ocean Optics (Ocean Insight) spectrometers on USB, through python-seabreeze.

Needs the extra `labrig[seabreeze]`, of which the part in pure Python on pyusb is used, so that the
USB device is found and locked as a camera's is. Limits, dark pixels, wavelengths and the polynomial
of relative response come from the instrument and from seabreeze's tables of models.
"""

import errno
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import usb.core

from labrig.acquire import Connections, Finding, require_integration
from labrig.foundation import resources
from labrig.foundation.errors import DeviceError, DeviceLostError, UnclearAnswerError, UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.named_files import ShippedOrFile
from labrig.optics import SpectrometerReading, Spectrum, read_spectrum

if TYPE_CHECKING:
    from seabreeze.pyseabreeze.devices import SeaBreezeDevice

#: Longest integration: one that runs cannot be interrupted.
MAX_S = 10.0
#: Part of the converter's range from which a pixel counts as saturated.
SATURATED = 0.99
#: Errors of a device that is gone, on Linux, macOS and Windows.
GONE = (errno.ENODEV, errno.EIO, errno.ENOENT, errno.ENXIO)

T = TypeVar("T")


class SeabreezeSpectrometer:
    """A spectrometer of Ocean Optics, such as the USB2000+, the Flame or the USB4000.

    It integrates all the time, so that the first spectrum of each reading, which may have begun
    before, is discarded.

    Parameters
    ----------
    address
        USB device, such as `usb://2457:101e`, with `/SERIAL` behind it if there are several.
    settings
        The rig file's keys for this device.
    connections
        Connections that find the device.

    Raises
    ------
    UsageError
        The extra is not installed, or the calibration's file is missing or malformed.
    DeviceError
        There is no such device, access to it is refused, or it is none that seabreeze knows.
    """

    class Settings(FrozenModel):
        """Keys of an Ocean Optics spectrometer in a rig file.

        Attributes
        ----------
        calibration
            File with the absolute scale, or name of a shipped one: irradiance in W m⁻² nm⁻¹ of a
            light that gives one corrected count per second, `wavelength_nm,value,sigma`, made by
            `labrig.optics.lamp_calibration` from a reading under a standard lamp. Default: counts
            are relative.
        """

        calibration: ShippedOrFile | None = None

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        _require_seabreeze()
        self._address = address
        self._connections = connections
        self._clock = connections.clock
        self._name = f"the spectrometer at {address}"
        self._calibration: Spectrum | None = None
        if settings.calibration is not None:
            self._calibration = read_spectrum(resources.curve_path(settings.calibration))
        self._device: SeaBreezeDevice | None = None
        self._open()

    def identity(self) -> str:
        """Return model, serial number, and range of wavelengths."""
        grid_nm = self._wavelength_nm
        return (
            f"Ocean Optics {self._opened().model}, serial {self._opened().serial_number}, "
            f"{len(grid_nm)} pixels, {grid_nm[0]:.1f} nm to {grid_nm[-1]:.1f} nm"
        )

    def findings(self) -> Sequence[Finding]:
        """Return whether dark pixels, response and absolute scale are known."""
        findings = []
        if not self._dark_pixels:
            findings.append(
                Finding(
                    "warn",
                    "this model has no dark pixels: its offset is known from dark readings only",
                    "let a protocol take them often",
                )
            )
        if not self._nonlinearity:
            findings.append(
                Finding(
                    "warn",
                    "it has no polynomial of relative response: bright lines come out up to some "
                    "per cent too low",
                    "keep counts below half of the range",
                )
            )
        if self._calibration is None:
            findings.append(Finding("fine", "no absolute scale: its counts are relative"))
        return findings or [Finding("fine", "dark, response and absolute scale are known")]

    def integration_limits_s(self) -> tuple[float, float]:
        """Return the shortest and the longest integration time in seconds."""
        return self._limits_s

    def read(self, integration_s: float, repetitions: int) -> SpectrometerReading:
        """Return raw counts of light that falls in from now on; may be interrupted in between.

        Parameters
        ----------
        integration_s
            Integration time of each repetition in seconds.
        repetitions
            Number of repetitions.

        Raises
        ------
        ProtocolError
            The instrument does not offer that integration time.
        DeviceLostError
            It is gone, or its answer is missing or too short.
        """
        require_integration(integration_s, self._limits_s)
        microseconds = round(integration_s * 1e6)
        feature = self._opened().f.spectrometer
        self._ask("setting the integration time", feature.set_integration_time_micros, microseconds)
        spectra = []
        for _ in range(repetitions + 1):
            self._clock.sleep(0.0)
            spectra.append(self._ask("reading a spectrum", feature.get_intensities))
        return SpectrometerReading(
            wavelength_nm=self._wavelength_nm,
            raw_counts=np.array(spectra[1:], dtype=np.float64),
            integration_s=microseconds / 1e6,
            saturation_counts=SATURATED * self._full_counts,
            dark_pixels=self._dark_pixels,
            nonlinearity=self._nonlinearity,
            calibration=self._calibration,
        )

    def make_safe(self) -> None:
        """Open it anew if it failed; no spectrometer is unsafe, not even one that is gone."""
        with suppress(DeviceError):
            self._opened()

    def disconnect(self) -> None:
        """Release the device."""
        self._close()

    def _opened(self) -> "SeaBreezeDevice":
        """Return the device, opened anew after a failure."""
        if self._device is None:
            self._open()
        assert self._device is not None
        return self._device

    def _open(self) -> None:
        from seabreeze.pyseabreeze.devices import SeaBreezeDevice

        found = self._connections.usb(self._address, _serial_number)
        device = _seabreeze_device(found, self._name)
        with _device_errors(self._name, "opening it"):
            device.open()
            feature = device.f.spectrometer
            self._wavelength_nm = np.asarray(feature.get_wavelengths(), dtype=np.float64)
            low_us, high_us = feature.get_integration_time_micros_limits()
            self._dark_pixels = tuple(int(n) for n in feature.get_electric_dark_pixel_indices())
            self._full_counts = float(feature.get_maximum_intensity())
            self._nonlinearity = _nonlinearity(device)
        if (np.diff(self._wavelength_nm) <= 0).any():
            raise DeviceError(
                f"{self._name} has wavelengths that do not rise; its EEPROM is damaged: let its "
                "maker restore it"
            )
        self._limits_s = low_us * 1e-6, min(high_us * 1e-6, MAX_S)
        assert isinstance(device, SeaBreezeDevice)
        self._device = device

    def _close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            with suppress(Exception):  # whatever is left of it, the next opening begins anew
                device.close()

    def _ask(self, what: str, act: Callable[..., T], *arguments: Any) -> T:
        """Return what the device answers; after a failure it is opened anew before the next."""
        try:
            with _device_errors(self._name, what):
                return act(*arguments)
        except DeviceError:
            self._close()
            raise


def _require_seabreeze() -> None:
    try:
        import seabreeze.pyseabreeze
    except ImportError as error:
        raise UsageError(
            f"the driver 'seabreeze_spectrometer' needs python-seabreeze ({error}): "
            "pip install 'labrig[seabreeze]'"
        ) from None
    del seabreeze


def _seabreeze_device(found: Any, name: str) -> "SeaBreezeDevice":
    """Return seabreeze's device for one of pyusb's.

    Raises
    ------
    DeviceError
        It is no spectrometer that seabreeze knows.
    """
    from seabreeze.pyseabreeze.devices import SeaBreezeDevice
    from seabreeze.pyseabreeze.transport import USBTransportHandle

    try:
        return SeaBreezeDevice(USBTransportHandle(found))
    except (KeyError, TypeError):
        raise DeviceError(
            f"{name} ({found.idVendor:04x}:{found.idProduct:04x}) is no spectrometer that "
            "python-seabreeze knows; check the address"
        ) from None


def _serial_number(found: Any) -> str:
    """Return the serial number in a spectrometer's EEPROM."""
    name = f"the spectrometer {found.idVendor:04x}:{found.idProduct:04x}"
    device = _seabreeze_device(found, name)
    with _device_errors(name, "asking for its serial number"):
        device.open()
        try:
            return str(device.serial_number)
        finally:
            device.close()


def _nonlinearity(device: "SeaBreezeDevice") -> tuple[float, ...]:
    """Return the coefficients of relative response; none where the instrument has none."""
    from seabreeze.spectrometers import SeaBreezeError

    feature = device.f.nonlinearity_coefficients
    if feature is None:
        return ()
    try:
        coefficients = tuple(float(one) for one in feature.get_nonlinearity_coefficients())
    except (SeaBreezeError, ValueError):  # an EEPROM without them
        return ()
    return coefficients if np.isfinite(coefficients).all() and any(coefficients) else ()


@contextmanager
def _device_errors(name: str, what: str) -> Iterator[None]:
    """Turn what pyusb and seabreeze raise into errors that say what to do.

    Raises
    ------
    DeviceLostError
        The device is gone.
    UnclearAnswerError
        Its answer is missing, too short or unintelligible.
    DeviceError
        Another program holds it, or access is refused.
    """
    from seabreeze.pyseabreeze.transport import USBTransportDeviceInUse, USBTransportError
    from seabreeze.spectrometers import SeaBreezeError

    try:
        yield
    except usb.core.USBTimeoutError:
        raise UnclearAnswerError(
            f"{name} did not answer in time ({what}); unplug it and plug it in again"
        ) from None
    except (usb.core.USBError, USBTransportError) as error:
        reason = " ".join(str(error).split())
        if error.errno in GONE:
            raise DeviceLostError(f"{name} is gone ({reason}); plug it in again") from None
        raise DeviceError(
            f"{name} refuses access ({reason}); on Linux allow it by a udev rule, such as those of "
            "'seabreeze_os_setup', and end other programs that use it"
        ) from None
    except USBTransportDeviceInUse:
        raise DeviceError(f"{name} is in use; end the other program that uses it") from None
    except (SeaBreezeError, ValueError, IndexError, AssertionError, struct.error) as error:
        reason = " ".join(str(error).split())
        raise UnclearAnswerError(
            f"{name} gave an answer that is too short or damaged ({what}: {reason}); check its "
            "cable, and connect it without a hub"
        ) from None
