"""Banks of lights of which at most one is lit: methods, stand-in, switching, gentle exercise."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol, runtime_checkable

from labrig.acquire.roles.role import (
    DARK,
    ExerciseContext,
    Exercised,
    Light,
    Measured,
    PlannedDevice,
    spread_ms,
)
from labrig.foundation.errors import DeviceError, ProtocolError
from labrig.foundation.quantity import duration_text
from labrig.foundation.yaml_file import did_you_mean
from labrig.optics import Spectrum


@runtime_checkable
class LightBank(Light, Protocol):
    """Lights of which at most one is on. Safe state: all off."""

    def channels(self) -> tuple[str, ...]:
        """Return the names of the lights."""

    def settling_s(self, channel: str, /) -> float:
        """Return the time in seconds from switching a light on until it is steady."""

    def light(self, channel: str, /) -> None:
        """Switch one light on after all others are off; both are read back where the device can.

        It is steady `settling_s` later, for which protocols wait themselves.
        """

    def dark(self) -> None:
        """Switch all lights off, read back where the device can."""

    def channel_on(self) -> str | None:
        """Return the light that is on, None if all are off: as read back where the device can.

        Raises
        ------
        DeviceError
            If more than one light is on.
        """


class KnownLight(Protocol):
    """Settings of one light of a bank in a rig file."""

    @property
    def settling(self) -> float:
        """Time in seconds from switching on until the light is steady."""

    def relative_spectrum(self) -> Spectrum | None:
        """Return the spectrum per nm in relative units, None if the rig file says nothing of it.

        Raises
        ------
        UsageError
            A file is missing or malformed.
        """


class PlannedLightBank(PlannedDevice):
    """Stand-in of a bank of lights in a plan; protocols wait for a light's settling themselves.

    Files of spectra are read, so that a missing one is found before anything moves.
    """

    def __init__(self, lights: Mapping[str, KnownLight]) -> None:
        for light in lights.values():
            light.relative_spectrum()
        self._lights = dict(lights)
        self._channel_on: str | None = None

    def reads_back(self) -> bool:
        """Return False: nothing else can switch a stand-in."""
        return False

    def channels(self) -> tuple[str, ...]:
        """Return the names that the driver declares."""
        return tuple(self._lights)

    def settling_s(self, channel: str, /) -> float:
        """Return the settling time in seconds that the driver declares."""
        return self._lights[channel].settling

    def light(self, channel: str, /) -> None:
        """Switch one light on."""
        self._channel_on = channel

    def dark(self) -> None:
        """Switch all lights off."""
        self._channel_on = None

    def channel_on(self) -> str | None:
        """Return the light that is on, as commanded last."""
        return self._channel_on


@dataclass(frozen=True)
class BankSwitch:
    """An action that switches one light of a bank on and all others off.

    Attributes
    ----------
    channel
        Name of the light; None to switch all off.
    """

    channel: str | None
    #: Key of the role, and what one of its lights is called.
    device: ClassVar[str]
    noun: ClassVar[str]

    def __str__(self) -> str:
        return DARK if self.channel is None else f"{self.channel} on"

    def begin(self, bank: LightBank) -> None:
        """Switch the lights.

        Raises
        ------
        ProtocolError
            If there is no such light.
        """
        if self.channel is None:
            bank.dark()
        elif self.channel in bank.channels():
            bank.light(self.channel)
        else:
            raise ProtocolError(
                f"the protocol lights {self.noun} '{self.channel}', which the rig has not; "
                f"{did_you_mean(self.channel, bank.channels())}"
            )


def exercise(bank: LightBank, context: ExerciseContext, *, nouns: str) -> Exercised:
    """Switch each light on for some hundredths of a second, once: arcs do not like it.

    `nouns` is what the lights are called in messages.
    """
    measured, off_s = [], []
    try:
        for channel in bank.channels():
            on_s = context.timed_s(partial(bank.light, channel))
            measured.append(Measured(f"{channel} on, read back", f"{on_s * 1e3:.1f} ms"))
            if settling_s := bank.settling_s(channel):
                text = f"{duration_text(settling_s)}, for which protocols wait"
                measured.append(Measured(f"{channel} settles, from the rig file", text))
            _require_state(bank, channel, nouns)
            off_s.append(context.timed_s(bank.dark))
            _require_state(bank, None, nouns)
    finally:
        with context.clock.shielded():
            bank.dark()
    return Exercised((*measured, Measured("off, read back", spread_ms(off_s))))


def _require_state(bank: LightBank, channel: str | None, nouns: str) -> None:
    if (channel_on := bank.channel_on()) != channel:
        raise DeviceError(
            f"the {nouns} were switched to {channel or 'dark'}, they say {channel_on or 'dark'}; "
            "look at them, switch them off by hand and check the relays"
        )
