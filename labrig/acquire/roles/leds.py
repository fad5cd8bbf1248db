"""The bank of LEDs, narrow bands of light that charge the sample, one at a time."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

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
from labrig.optics import Spectrum, read_spectrum
from labrig.quantity import DurationS, duration_text
from labrig.yaml_file import did_you_mean

FWHM_OVER_SIGMA = 2 * math.sqrt(2 * math.log(2))
#: Half width of the grid of a spectrum that is given by its centre and width, in widths.
TAIL_WIDTHS = 3.0


class LedLight(BaseModel):
    """The light of an LED as far as it is known: keys that every bank of LEDs has for each of them.

    Attributes
    ----------
    spectrum
        File with the spectrum of the LED, in relative units per nm; given instead of `centre` and
        `fwhm`.
    centre
        Wavelength of the LED's peak in nm, together with `fwhm`.
    fwhm
        Full width at half maximum of the LED's band in nm.
    settling
        Time from switching on until the LED's light is steady, for example `0.5 s`; protocols wait
        for it.

    Raises
    ------
    ValueError
        Both a file and a band are given, or half of a band.

    Examples
    --------
    >>> from labrig.acquire import LedLight
    >>> blue = LedLight.model_validate({"centre": 450, "fwhm": 20, "settling": "0.5 s"})
    >>> blue.relative_spectrum().at([440.0, 450.0, 460.0]).round(2).tolist()
    [0.5, 1.0, 0.5]
    >>> blue.peak_nm(), blue.settling
    (450.0, 0.5)
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    spectrum: str | None = None
    centre: Annotated[float, Field(ge=200, le=1200)] | None = None
    fwhm: Annotated[float, Field(ge=1, le=400)] | None = None
    settling: Annotated[DurationS, Field(ge=0, le=600)] = 0.0

    @model_validator(mode="after")
    def _one_description(self) -> Self:
        if (self.centre is None) != (self.fwhm is None):
            raise ValueError("expected 'centre' and 'fwhm' together")
        if self.spectrum is not None and self.centre is not None:
            raise ValueError("expected 'spectrum', or 'centre' and 'fwhm'; got both")
        return self

    def relative_spectrum(self) -> Spectrum | None:
        """Return the spectrum per nm in relative units, None if the rig file says nothing of it.

        A band that is given by centre and width is a normal distribution; a real one is skewed.

        Raises
        ------
        UsageError
            The file is missing or malformed.
        """
        if self.spectrum is not None:
            return read_spectrum(self.spectrum)
        if self.centre is None or self.fwhm is None:
            return None
        offset = np.linspace(-TAIL_WIDTHS, TAIL_WIDTHS, round(40 * TAIL_WIDTHS) + 1)
        shape = np.exp(-((offset * FWHM_OVER_SIGMA) ** 2) / 2)
        return Spectrum(f"{self.centre:g} nm", self.centre + offset * self.fwhm, shape)

    def peak_nm(self) -> float | None:
        """Return the wavelength of the peak in nm, None if the rig file says nothing of it.

        Raises
        ------
        UsageError
            The file of the spectrum is missing or malformed.
        """
        spectrum = self.relative_spectrum()
        if spectrum is None:
            return None
        return float(spectrum.wavelength_nm[spectrum.value.argmax()])


@runtime_checkable
class LedBank(Light, Protocol):
    """Narrow-band LEDs of which at most one is on. Safe state: all off."""

    def channels(self) -> tuple[str, ...]:
        """Return the names of the LEDs."""

    def settling_s(self, channel: str, /) -> float:
        """Return the time in seconds from switching an LED on until its light is steady."""

    def light(self, channel: str, /) -> None:
        """Switch one LED on after all others are off; both are read back where the device can.

        The light is steady `settling_s` later, for which protocols wait themselves.
        """

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
    """Stand-in of a bank of LEDs in a plan; protocols wait for its settling themselves.

    Files of spectra are read, so that a missing one is found before anything moves.
    """

    def __init__(self, leds: Mapping[str, LedLight]) -> None:
        for light in leds.values():
            light.relative_spectrum()
        self._leds = dict(leds)
        self._channel_on: str | None = None

    def reads_back(self) -> bool:
        """Return False: nothing else can switch a stand-in."""
        return False

    def channels(self) -> tuple[str, ...]:
        """Return the names that the driver declares."""
        return tuple(self._leds)

    def settling_s(self, channel: str, /) -> float:
        """Return the settling time in seconds that the driver declares."""
        return self._leds[channel].settling

    def light(self, channel: str, /) -> None:
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
            if settling_s := leds.settling_s(channel):
                text = f"{duration_text(settling_s)}, for which protocols wait"
                measured.append(Measured(f"{channel} settles, from the rig file", text))
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
    planned=lambda driver, settings, clock: PlannedLedBank(driver.declared_leds(settings)),
    exercise=_exercise,
    state=lambda leds: str(LedSwitch(leds.channel_on())),
    safe_first=True,
)
