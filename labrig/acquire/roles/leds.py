"""The bank of LEDs, narrow bands of light that charge the sample, one at a time."""

from collections.abc import Sequence
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
    Role,
    spread_ms,
)
from labrig.errors import DeviceError, ProtocolError
from labrig.yaml_file import did_you_mean


@runtime_checkable
class LedBank(Light, Protocol):
    """Narrow-band LEDs of which at most one is on. Safe state: all off."""

    def channels(self) -> tuple[str, ...]:
        """Return the names of the LEDs."""

    def light(self, channel: str) -> None:
        """Switch one LED on after all others are off; both are read back where the device can."""

    def dark(self) -> None:
        """Switch all LEDs off, read back where the device can."""

    def channel_on(self) -> str | None:
        """Return the LED that is on, None if all are off: as read back where the device can.

        Raises
        ------
        DeviceError
            If more than one LED is on.
        """


class PlannedLedBank(PlannedDevice):
    """Stand-in of a bank of LEDs in a plan."""

    def __init__(self, channels: Sequence[str]) -> None:
        self._channels = tuple(channels)
        self._channel_on: str | None = None

    def reads_back(self) -> bool:
        """Return False: nothing else can switch a stand-in."""
        return False

    def channels(self) -> tuple[str, ...]:
        """Return the names that the driver declares."""
        return self._channels

    def light(self, channel: str) -> None:
        """Switch one LED on."""
        self._channel_on = channel

    def dark(self) -> None:
        """Switch all LEDs off."""
        self._channel_on = None

    def channel_on(self) -> str | None:
        """Return the LED that is on, as commanded last."""
        return self._channel_on


@dataclass(frozen=True)
class LedSwitch:
    """The action that switches one LED on and all others off.

    Attributes
    ----------
    channel
        Name of the LED; None to switch all off.
    """

    channel: str | None
    device: ClassVar[str] = "leds"

    def __str__(self) -> str:
        return DARK if self.channel is None else f"{self.channel} on"

    def begin(self, leds: LedBank) -> None:
        """Switch the LEDs.

        Raises
        ------
        ProtocolError
            If there is no such LED.
        """
        if self.channel is None:
            leds.dark()
        elif self.channel in leds.channels():
            leds.light(self.channel)
        else:
            raise ProtocolError(
                f"the protocol lights an LED '{self.channel}', which the rig has not; "
                f"{did_you_mean(self.channel, leds.channels())}"
            )


LEDS_OFF = LedSwitch(None)


def _exercise(leds: LedBank, context: ExerciseContext) -> Exercised:
    """Switch each LED on for some hundredths of a second."""
    measured, off_s = [], []
    try:
        for channel in leds.channels():
            on_s = context.timed_s(partial(leds.light, channel))
            measured.append(Measured(f"{channel} on, read back", f"{on_s * 1e3:.1f} ms"))
            _require_state(leds, channel)
            off_s.append(context.timed_s(leds.dark))
            _require_state(leds, None)
    finally:
        with context.clock.shielded():
            leds.dark()
    return Exercised((*measured, Measured("off, read back", spread_ms(off_s))))


def _require_state(leds: LedBank, channel: str | None) -> None:
    if (channel_on := leds.channel_on()) != channel:
        raise DeviceError(
            f"the LEDs were switched to {channel or 'dark'}, they say {channel_on or 'dark'}; look "
            "at them, switch them off by hand and check the relays"
        )


LEDS: Role[LedBank] = Role(
    key="leds",
    protocol_class=LedBank,
    name="bank of LEDs",
    planned=lambda driver, settings, clock: PlannedLedBank(driver.declared_channels(settings)),
    exercise=_exercise,
    state=lambda leds: str(LedSwitch(leds.channel_on())),
    safe_first=True,
)
