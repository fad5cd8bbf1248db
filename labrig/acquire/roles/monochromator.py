"""The monochromator between lamp and sample, which lets a narrow band through."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from labrig.acquire.roles.role import (
    Device,
    ExerciseContext,
    Exercised,
    Measured,
    PlannedDevice,
    Role,
)
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, duration_text
from labrig.optics import Transmittance

#: Wavelengths in nm at which it is tried.
TRIED_NM = (450.0, 550.0, 650.0)
#: Points of its band over half of its base, and how far the curve of its band goes beyond.
POINTS, BEYOND_NM = 20, 1.0


class MonochromatorBand(FrozenModel):
    """What a monochromator lets through: keys that every one has in a rig file.

    Attributes
    ----------
    fwhm
        Full width at half maximum of the band in nm, by slits and grating.
    wavelength_sigma
        Standard uncertainty of its wavelength scale in nm.
    lowest, highest
        Wavelengths in nm between which it can be tuned.
    travel
        Longest time of a change of the wavelength, for example `20 s`.
    """

    fwhm: Annotated[float, Field(ge=0.5, le=100)]
    wavelength_sigma: Annotated[float, Field(ge=0, le=10)] = 0.5
    lowest: Annotated[float, Field(ge=150)] = 350.0
    highest: Annotated[float, Field(le=3000)] = 750.0
    travel: Annotated[DurationS, Field(gt=0, le=600)] = 30.0

    def transmittance(self, wavelength_nm: float) -> Transmittance:
        """Return the relative transmittance: a triangle, as of equal slits."""
        offset_nm = self.fwhm * np.arange(-POINTS, POINTS + 1) / POINTS
        shape = 1 - np.abs(offset_nm) / self.fwhm
        grid_nm = wavelength_nm + np.concatenate(
            [[-self.fwhm - BEYOND_NM], offset_nm, [self.fwhm + BEYOND_NM]]
        )
        return Transmittance(f"{wavelength_nm:g} nm", grid_nm, np.pad(shape, 1))


@runtime_checkable
class Monochromator(Device, Protocol):
    """A monochromator before the lamp. Safe state: at rest."""

    def tune(self, wavelength_nm: float, /) -> None:
        """Go to a wavelength in nm, shutter open; return when it is there.

        Raises
        ------
        DeviceError
            It does not confirm that it is there.
        """

    def limits_nm(self) -> tuple[float, float]:
        """Return the wavelengths in nm between which it can be tuned."""


class PlannedMonochromator(PlannedDevice):
    """Stand-in of a monochromator in a plan, for which every change takes the longest time."""

    def __init__(self, clock: VirtualClock, band: MonochromatorBand) -> None:
        self._clock = clock
        self._band = band
        self._wavelength_nm: float | None = None

    def tune(self, wavelength_nm: float, /) -> None:
        """Let the time of a change pass, unless it is there."""
        if wavelength_nm != self._wavelength_nm:
            self._clock.spend(self._band.travel)
        self._wavelength_nm = wavelength_nm

    def limits_nm(self) -> tuple[float, float]:
        """Return the limits that the driver declares."""
        return self._band.lowest, self._band.highest


@dataclass(frozen=True)
class Tune:
    """The action that tunes the monochromator."""

    wavelength_nm: float
    device: ClassVar[str] = "monochromator"

    def __str__(self) -> str:
        return f"{self.wavelength_nm:g} nm"

    def begin(self, monochromator: Monochromator) -> None:
        """Tune it, and wait until it is there.

        Raises
        ------
        ProtocolError
            It cannot be tuned to that wavelength.
        """
        low_nm, high_nm = monochromator.limits_nm()
        if not low_nm <= self.wavelength_nm <= high_nm:
            raise ProtocolError(
                f"the protocol tunes the monochromator to {self.wavelength_nm:g} nm, expected "
                f"{low_nm:g} nm to {high_nm:g} nm; see 'lowest' and 'highest' in the rig file"
            )
        monochromator.tune(self.wavelength_nm)


def _exercise(monochromator: Monochromator, context: ExerciseContext) -> Exercised:
    """Go to some wavelengths."""
    low_nm, high_nm = monochromator.limits_nm()
    return Exercised(
        tuple(
            Measured(
                f"to {nm:g} nm", duration_text(context.timed_s(partial(monochromator.tune, nm)))
            )
            for nm in TRIED_NM
            if low_nm <= nm <= high_nm
        )
    )


MONOCHROMATOR: Role[Monochromator] = Role(
    key="monochromator",
    protocol_class=Monochromator,
    name="monochromator",
    planned=lambda settings, clock: PlannedMonochromator(clock, settings),
    exercise=_exercise,
)
