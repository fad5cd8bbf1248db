"""The spectrometer, which measures the spectral distribution of light."""

from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from labrig.acquire.roles.role import (
    Device,
    ExerciseContext,
    Exercised,
    Finding,
    Measured,
    PlannedDevice,
    Role,
)
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text
from labrig.optics import SpectrometerReading

#: Longest integration: one that runs cannot be interrupted, and dark current fills the pixels.
MAX_S = 10.0
#: Shortest and longest integration in a plan, which has not asked the instrument.
PLANNED_LIMITS_S = (1e-3, MAX_S)
#: Largest number of repetitions of one reading.
MAX_REPETITIONS = 1000
#: Exercise: integration time and number of repetitions.
EXERCISE_S, EXERCISE_REPETITIONS = 0.1, 10
#: Part of the range above the dark pixels from which it is not dark.
LIGHT = 0.02


@runtime_checkable
class Spectrometer(Device, Protocol):
    """An instrument that measures relative or absolute spectral irradiance. Safe state: idle."""

    def integration_limits_s(self) -> tuple[float, float]:
        """Return the shortest and the longest integration time in seconds."""

    def read(self, integration_s: float, repetitions: int) -> SpectrometerReading:
        """Return raw counts of light that falls in from now on.

        Parameters
        ----------
        integration_s
            Integration time of each repetition in seconds.
        repetitions
            Number of repetitions.

        Raises
        ------
        ProtocolError
            If the instrument does not offer that integration time.
        DeviceError
            If the instrument did not deliver.
        """


class PlannedSpectrometer(PlannedDevice):
    """Stand-in of a spectrometer in a plan, whose readings take their time and have no light."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock

    def integration_limits_s(self) -> tuple[float, float]:
        """Return limits that all instruments have."""
        return PLANNED_LIMITS_S

    def read(self, integration_s: float, repetitions: int) -> SpectrometerReading:
        """Let the time of a reading pass: of the repetitions, and of one that is discarded."""
        require_integration(integration_s, PLANNED_LIMITS_S)
        self._clock.spend((repetitions + 1) * integration_s)
        nothing = np.zeros((repetitions, 2))
        return SpectrometerReading(np.array([300.0, 900.0]), nothing, integration_s, np.inf)


def require_integration(integration_s: float, limits_s: tuple[float, float]) -> None:
    """Refuse an integration time beyond an instrument's limits.

    Parameters
    ----------
    integration_s
        Integration time in seconds that is asked for.
    limits_s
        Shortest and longest integration time of the instrument in seconds.

    Raises
    ------
    ProtocolError
        If it is too short or too long.

    Examples
    --------
    >>> from labrig.acquire import require_integration
    >>> require_integration(0.1, (0.001, 10.0))
    """
    low_s, high_s = limits_s
    if not low_s * (1 - 1e-9) <= integration_s <= high_s * (1 + 1e-9):
        raise ProtocolError(
            f"the spectrometer does not offer an integration time of "
            f"{duration_text(integration_s)}; {duration_text(low_s)} to {duration_text(high_s)} "
            "are offered: for longer ones repeat it"
        )


@dataclass(frozen=True)
class ReadSpectrum:
    """The action that reads a spectrum, which the session records.

    A dark reading is one with the lights off that a protocol takes itself, by a role such as
    `dark`.

    Attributes
    ----------
    role
        Purpose of the reading, such as `dark` or `led`.
    integration_s
        Integration time of each repetition in seconds.
    repetitions
        Number of repetitions.

    Raises
    ------
    ProtocolError
        The number of repetitions is not from 1 to `MAX_REPETITIONS`.
    """

    role: str
    integration_s: float
    repetitions: int = 10
    device: ClassVar[str] = "spectrometer"

    def __post_init__(self) -> None:
        if not 1 <= self.repetitions <= MAX_REPETITIONS:
            raise ProtocolError(
                f"expected 1 to {MAX_REPETITIONS} repetitions of a spectrum, got {self.repetitions}"
            )

    def __str__(self) -> str:
        return f"{self.role} spectrum, {duration_text(self.integration_s)} x {self.repetitions}"


def _exercise(spectrometer: Spectrometer, context: ExerciseContext) -> Exercised:
    """Read a spectrum with the lights off."""
    low_s, high_s = spectrometer.integration_limits_s()
    start_s = context.clock.now()
    integration_s = min(max(EXERCISE_S, low_s), high_s)
    reading = spectrometer.read(integration_s, EXERCISE_REPETITIONS)
    duration_s = context.clock.now() - start_s
    counts = reading.corrected().counts
    noise = float(np.median(reading.raw_counts.std(axis=0, ddof=1)))
    brightest = float(np.percentile(counts, 99)) / reading.saturation_counts
    grid_nm = reading.wavelength_nm
    return Exercised(
        (
            Measured("pixels", f"{len(grid_nm)}, {grid_nm[0]:.1f} nm to {grid_nm[-1]:.1f} nm"),
            Measured("integration", f"{duration_text(low_s)} to {duration_text(high_s)}"),
            Measured(
                f"{EXERCISE_REPETITIONS} spectra of {duration_text(integration_s)}",
                f"{duration_text(duration_s)}, noise {noise:.1f} counts",
            ),
        ),
        (_darkness(brightest),),
    )


def _darkness(brightest: float) -> Finding:
    if brightest > LIGHT:
        return Finding(
            "warn",
            f"with the lights off it sees light ({100 * brightest:.0f} % of its range)",
            "darken the room, cover displays, and let the samples fade",
        )
    return Finding("fine", "with the lights off it sees none")


SPECTROMETER: Role[Spectrometer] = Role(
    key="spectrometer",
    protocol_class=Spectrometer,
    name="spectrometer",
    planned=lambda settings, clock: PlannedSpectrometer(clock),
    exercise=_exercise,
)
