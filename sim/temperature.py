"""The room's temperature, and what re-radiation makes of it."""

import math
from collections.abc import Callable

from .bench_settings import TemperatureSettings
from .sensor import AMBIENT_C

#: Depth of the traps over Boltzmann's constant, K: 0.65 eV.
TRAP_K = 0.65 / 8.617333e-5
ZERO_C_K = 273.15


def quickening(settings: TemperatureSettings | None) -> Callable[[float], float]:
    """By how much re-radiation is faster at a time than at 21 °C, where materials were measured."""
    if settings is None:
        return lambda _: 1.0

    def faster(time_s: float) -> float:
        now_k = settings.celsius(time_s) + ZERO_C_K
        return math.exp(TRAP_K * (1 / (AMBIENT_C + ZERO_C_K) - 1 / now_k))

    return faster
