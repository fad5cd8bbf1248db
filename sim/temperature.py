"""The room's temperature, its effect on re-radiation, and its sensor."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from labrig.foundation.clock import VirtualClock

from .bench_settings import TemperatureSettings
from .faults import FaultTime
from .sensor import AMBIENT_C

#: Depth of the traps over Boltzmann's constant, K: 0.65 eV.
TRAP_K = 0.65 / 8.617333e-5
ZERO_C_K = 273.15

#: Voltage of a TMP36: 0.75 V at 25 °C and 10 mV for a degree more.
VOLTS_AT_25, VOLTS_PER_K = 0.75, 0.01
#: Constant error of a sensor, 1 σ in K.
SENSOR_SIGMA_K = 0.3
#: Noise of each conversion, 1 σ: the sensor's own, the supply's and the converter's.
NOISE_V = 0.004
#: Voltage of an input from which the sensor's wire has come off.
OPEN_V = 5.0


def celsius(settings: TemperatureSettings | None, time_s: float) -> float:
    """Return the temperature of the room, by default 21 °C, to which a material's rates belong."""
    return AMBIENT_C if settings is None else settings.celsius(time_s)


def rate_factor(settings: TemperatureSettings | None) -> Callable[[float], float]:
    """Return the factor by which re-radiation is faster than at 21 °C, at a time."""
    if settings is None:
        return lambda _: 1.0

    def faster(time_s: float) -> float:
        now_k = settings.celsius(time_s) + ZERO_C_K
        return math.exp(TRAP_K * (1 / (AMBIENT_C + ZERO_C_K) - 1 / now_k))

    return faster


class TemperatureSensor:
    """A TMP36 beside the sample.

    Parameters
    ----------
    settings
        Settings of the room's temperature.
    clock
        The room's clock.
    rng
        Random generator of the sensor's error and noise.
    off
        Times at which its wire has come off.
    """

    def __init__(
        self,
        settings: TemperatureSettings | None,
        clock: VirtualClock,
        rng: np.random.Generator,
        off: Sequence[FaultTime] = (),
    ) -> None:
        self._settings = settings
        self._clock = clock
        self._rng = rng
        self._off = off
        self._error_k = rng.normal(0.0, SENSOR_SIGMA_K)

    def volts(self) -> float:
        """Return the present voltage of the sensor."""
        now_s = self._clock.now()
        if any(span.is_on(now_s) for span in self._off):
            return OPEN_V
        celsius_shown = celsius(self._settings, now_s) + self._error_k
        return VOLTS_AT_25 + VOLTS_PER_K * (celsius_shown - 25.0) + self._rng.normal(0.0, NOISE_V)
