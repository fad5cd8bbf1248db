"""The bank of broadband lamps, under which samples are seen as in daily life, one at a time."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, Protocol, runtime_checkable

from pydantic import Field

from labrig import resources
from labrig.acquire.roles.leds import LedLight
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
from labrig.optics import Spectrum, read_light
from labrig.quantity import DurationS, duration_text
from labrig.yaml_file import did_you_mean


class Illuminant(LedLight):
    """The light of a lamp as far as it is known: keys of each lamp of a bank.

    Attributes
    ----------
    spectrum
        Spectrum of the lamp in relative units per nm: a CIE illuminant such as `D65`, the name of a
        shipped file such as `halogen_3000k`, or the path of a file; given instead of `centre` and
        `fwhm`.
    settling
        Time from switching on until the lamp is warm and its light steady, for example `10 min`;
        protocols wait for it.
    filter
        Colour filter that is fixed before the lamp, by its name in the rig's folder of filters.
        Default: none.

    Examples
    --------
    >>> from labrig.acquire import Illuminant
    >>> lamp = Illuminant.model_validate({"spectrum": "halogen_3000k", "settling": "10 min"})
    >>> lamp.settling, lamp.relative_spectrum().at([450.0, 650.0]).round(2).tolist()
    (600.0, [0.39, 1.49])
    """

    settling: Annotated[DurationS, Field(ge=0, le=7200)] = 0.0
    filter: Annotated[str, Field(min_length=1)] | None = None

    def relative_spectrum(self) -> Spectrum | None:
        """Return the spectrum per nm without the filter, None if the rig file says nothing of it.

        Raises
        ------
        UsageError
            There is no such illuminant and no such file, or the file is malformed.
        """
        if self.spectrum is None:
            return super().relative_spectrum()
        shipped = resources.curve_path(self.spectrum)
        return read_light(shipped if shipped.exists() else self.spectrum)


@runtime_checkable
class LampBank(Light, Protocol):
    """Broadband lamps of which at most one is on. Safe state: all off."""

    def lamps(self) -> tuple[str, ...]:
        """Return the names of the lamps."""

    def settling_s(self, lamp: str, /) -> float:
        """Return the time in seconds from switching a lamp on until its light is steady."""

    def light(self, lamp: str, /) -> None:
        """Switch one lamp on after all others are off; both are read back where possible.

        The light is steady `settling_s` later, for which protocols wait themselves.
        """

    def dark(self) -> None:
        """Switch all lamps off, read back where the device can."""

    def lamp_on(self) -> str | None:
        """Return the lamp that is on, None if all are off: as read back where the device can.

        Raises
        ------
        DeviceError
            If more than one lamp is on.
        """


class PlannedLampBank(PlannedDevice):
    """Stand-in of a bank of lamps in a plan; protocols wait for a lamp's settling themselves.

    Files of spectra are read, so that a missing one is found before anything moves.
    """

    def __init__(self, lamps: Mapping[str, Illuminant]) -> None:
        for lamp in lamps.values():
            lamp.relative_spectrum()
        self._lamps = dict(lamps)
        self._lamp_on: str | None = None

    def reads_back(self) -> bool:
        """Return False: nothing else can switch a stand-in."""
        return False

    def lamps(self) -> tuple[str, ...]:
        """Return the names that the driver declares."""
        return tuple(self._lamps)

    def settling_s(self, lamp: str, /) -> float:
        """Return the settling time in seconds that the driver declares."""
        return self._lamps[lamp].settling

    def light(self, lamp: str, /) -> None:
        """Switch one lamp on."""
        self._lamp_on = lamp

    def dark(self) -> None:
        """Switch all lamps off."""
        self._lamp_on = None

    def lamp_on(self) -> str | None:
        """Return the lamp that is on, as commanded last."""
        return self._lamp_on


@dataclass(frozen=True)
class IlluminantSwitch:
    """The action that switches one lamp of the bank on and all others off.

    Attributes
    ----------
    lamp
        Name of the lamp; None to switch all off.
    """

    lamp: str | None
    device: ClassVar[str] = "illuminants"

    def __str__(self) -> str:
        return DARK if self.lamp is None else f"{self.lamp} on"

    def begin(self, bank: LampBank) -> None:
        """Switch the lamps.

        Raises
        ------
        ProtocolError
            If there is no such lamp.
        """
        if self.lamp is None:
            bank.dark()
        elif self.lamp in bank.lamps():
            bank.light(self.lamp)
        else:
            raise ProtocolError(
                f"the protocol lights a lamp '{self.lamp}', which the rig has not; "
                f"{did_you_mean(self.lamp, bank.lamps())}"
            )


ILLUMINANTS_OFF = IlluminantSwitch(None)


def _exercise(bank: LampBank, context: ExerciseContext) -> Exercised:
    """Switch each lamp on for some hundredths of a second, once: arcs do not like it."""
    measured, off_s = [], []
    try:
        for lamp in bank.lamps():
            on_s = context.timed_s(partial(bank.light, lamp))
            measured.append(Measured(f"{lamp} on, read back", f"{on_s * 1e3:.1f} ms"))
            if settling_s := bank.settling_s(lamp):
                text = f"{duration_text(settling_s)}, for which protocols wait"
                measured.append(Measured(f"{lamp} settles, from the rig file", text))
            _require_state(bank, lamp)
            off_s.append(context.timed_s(bank.dark))
            _require_state(bank, None)
    finally:
        with context.clock.shielded():
            bank.dark()
    return Exercised((*measured, Measured("off, read back", spread_ms(off_s))))


def _require_state(bank: LampBank, lamp: str | None) -> None:
    if (lamp_on := bank.lamp_on()) != lamp:
        raise DeviceError(
            f"the lamps were switched to {lamp or 'dark'}, they say {lamp_on or 'dark'}; look at "
            "them, switch them off by hand and check the relays"
        )


ILLUMINANTS: Role[LampBank] = Role(
    key="illuminants",
    protocol_class=LampBank,
    name="bank of lamps",
    planned=lambda driver, settings, clock: PlannedLampBank(driver.declared_lamps(settings)),
    exercise=_exercise,
    state=lambda bank: str(IlluminantSwitch(bank.lamp_on())),
    safe_first=True,
)
