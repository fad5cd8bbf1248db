"""What a protocol may ask of a device. A driver fills one of these roles."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from labrig.acquire.findings import Finding
from labrig.acquire.values import CameraOffers, ExposureSettings, Frame


@runtime_checkable
class Device(Protocol):
    """What every device can do."""

    def identity(self) -> str:
        """One line that identifies the device that answers: maker, model, serial, firmware."""

    def make_safe(self) -> None:
        """Bring the line back into step, whatever was interrupted, then reach the safe state.

        Raises
        ------
        DeviceError
            The safe state could not be confirmed.
        """

    def disconnect(self) -> None:
        """Release the device. Never raises because it is gone already."""


@runtime_checkable
class Lamp(Device, Protocol):
    """A light that charges the sample. Safe: off."""

    def reads_back(self) -> bool:
        """Whether `is_on` is what the device says; else it is what was asked last."""

    def on(self) -> None:
        """Switch on, read back where the device can."""

    def off(self) -> None:
        """Switch off, read back where the device can."""

    def is_on(self) -> bool:
        """What the device says, not what was asked, where it reads back."""


@runtime_checkable
class LedBank(Device, Protocol):
    """Narrow-band LEDs, one lit at a time. Safe: all off."""

    def channels(self) -> tuple[str, ...]:
        """Names of the LEDs."""

    def light(self, channel: str) -> None:
        """Light one LED, all others off, read back."""

    def dark(self) -> None:
        """All off, read back."""


@runtime_checkable
class TrapDoor(Device, Protocol):
    """Swings the sample away from the filter and towards the camera. Safe: closed."""

    def open(self) -> None:
        """Begin to open; returns when the command is acknowledged."""

    def close(self) -> None:
        """Begin to close."""

    def travel_s(self) -> float:
        """Seconds from the command until the door has stopped."""


@runtime_checkable
class LampShield(Device, Protocol):
    """Keeps the afterglow of a lamp that is off from the sample (Nalbach et al., section 4.4).

    Safe: uncovered, since a hot lamp behind a shield cannot lose its heat.
    """

    def cover(self) -> None:
        """Begin to cover the lamp; returns when the command is acknowledged."""

    def uncover(self) -> None:
        """Begin to uncover it."""

    def travel_s(self) -> float:
        """Seconds from the command until the shield has stopped."""


@runtime_checkable
class Hands(Device, Protocol):
    """Do what a person would do at the bench: a sample changer, a filter wheel. Safe: still."""

    def do(self, task: str) -> None:
        """Do it; returns when it is done.

        Raises
        ------
        DeviceError
            They do not know how, or something went wrong.
        """


@runtime_checkable
class Camera(Device, Protocol):
    """A camera that delivers RAW frames. Safe: shutter released, nothing pending."""

    def offers(self) -> CameraOffers:
        """What it can be set to, as it is now."""

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; returns the settings in force, with the true shutter time.

        Raises
        ------
        DeviceError
            The camera does not offer them or did not take them.
        """

    def arm(self) -> None:
        """Do all that can be done beforehand, so that `shoot` starts without delay."""

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame."""


@runtime_checkable
class LiveView(Device, Protocol):
    """Shows what it sees, for aiming and focusing before the lights go out. Safe: switched off."""

    def preview(self) -> bytes:
        """One live picture, a JPEG. The first one starts the live view, `make_safe` stops it.

        Raises
        ------
        DeviceError
            There is no live view, or no picture comes.
        """


@runtime_checkable
class Checkable(Protocol):
    """A device that can say whether its own settings spoil a measurement."""

    def findings(self) -> Sequence[Finding]:
        """How it is set by hand, as far as it tells."""


@runtime_checkable
class KeptAwake(Protocol):
    """A device that switches itself off unless it is spoken to."""

    def keep_awake(self) -> None:
        """Make it count its time anew. Short, and harmless at any time between two actions."""


@runtime_checkable
class Guarded(Protocol):
    """A device with a watchdog: it goes to its safe state when it hears nothing for long."""

    def heartbeat(self) -> None:
        """Let it hear from this PC; takes milliseconds.

        Raises
        ------
        DeviceError
            Its watchdog has struck already.
        """


@runtime_checkable
class Spectrometer(Device, Protocol):
    """Measures relative spectral irradiance. Safe: idle."""

    def wavelengths_nm(self) -> tuple[float, ...]:
        """Wavelength of each pixel, ascending."""

    def counts(self, integration_s: float) -> tuple[float, ...]:
        """One reading, dark not subtracted, one value per wavelength."""


@runtime_checkable
class Thermometer(Device, Protocol):
    """Tells how warm it is at the sample, or in the room. Safe: anything; one may be gone."""

    def celsius(self) -> float:
        """Temperature now, in degrees Celsius; takes seconds at most, even when it fails."""


#: The key of a device in the rig file, and what it must be able to do.
ROLES: dict[str, type] = {
    "lamp": Lamp,
    "leds": LedBank,
    "shield": LampShield,
    "door": TrapDoor,
    "hands": Hands,
    "camera": Camera,
    "viewfinder": LiveView,
    "spectrometer": Spectrometer,
    "thermometer": Thermometer,
}

#: Those that give light: somebody has to know if one of them may be on.
LIGHTS = frozenset({"lamp", "leds"})

#: Which are made safe before all others, in this order.
SAFE_ORDER = {key: place for place, key in enumerate(("lamp", "leds", "shield", "door"))}
