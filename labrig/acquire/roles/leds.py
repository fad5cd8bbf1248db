"""The bank of LEDs: narrow bands of light that charge the sample, one at a time."""

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
    """Narrow-band LEDs, one lit at a time. Safe: all off."""

    def channels(self) -> tuple[str, ...]:
        """Names of the LEDs."""

    def light(self, channel: str) -> None:
        """Light one LED, once all others are off; both read back where the device can."""

    def dark(self) -> None:
        """All off, read back where the device can."""

    def lit(self) -> str | None:
        """The LED that is lit, None if all are off: what the device says, where it reads back.

        Raises
        ------
        DeviceError
            More than one is lit.
        """


class PlannedLedBank(PlannedDevice):
    """A bank of LEDs of a plan."""

    def __init__(self, channels: Sequence[str]) -> None:
        self._channels = tuple(channels)
        self._lit: str | None = None

    def reads_back(self) -> bool:
        """Nobody else switches it."""
        return False

    def channels(self) -> tuple[str, ...]:
        """As its driver declares."""
        return self._channels

    def light(self, channel: str) -> None:
        """Light it."""
        self._lit = channel

    def dark(self) -> None:
        """All off."""
        self._lit = None

    def lit(self) -> str | None:
        """As it was switched."""
        return self._lit


@dataclass(frozen=True)
class LedSwitch:
    """One LED is lit instead of another, or of none; None: all go off."""

    channel: str | None
    device: ClassVar[str] = "leds"

    def __str__(self) -> str:
        return DARK if self.channel is None else f"{self.channel} on"

    def begin(self, leds: LedBank) -> None:
        """Do it.

        Raises
        ------
        ProtocolError
            There is no such LED.
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


def _exercise(leds: LedBank, trial: ExerciseContext) -> Exercised:
    """Light each for some hundredths of a second."""
    measured, off_s = [], []
    try:
        for channel in leds.channels():
            on_s = trial.timed_s(partial(leds.light, channel))
            measured.append(Measured(f"{channel} on, read back", f"{on_s * 1e3:.1f} ms"))
            _require(leds, channel)
            off_s.append(trial.timed_s(leds.dark))
            _require(leds, None)
    finally:
        with trial.clock.shielded():
            leds.dark()
    return Exercised((*measured, Measured("off, read back", spread_ms(off_s))))


def _require(leds: LedBank, channel: str | None) -> None:
    if (found := leds.lit()) != channel:
        raise DeviceError(
            f"the LEDs were switched to {channel or 'dark'}, they say {found or 'dark'}; look at "
            "them, switch them off by hand and check the relays"
        )


LEDS: Role[LedBank] = Role(
    key="leds",
    does=LedBank,
    name="bank of LEDs",
    planned=lambda driver, settings, clock: PlannedLedBank(driver.declared_channels(settings)),
    exercise=_exercise,
    state=lambda leds: str(LedSwitch(leds.lit())),
    safe_first=True,
)
