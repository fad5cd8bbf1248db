"""Result of a decay run: the time series of every patch and the fit to it."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.foundation.region import Region
from labrig.results.decay_patch import ResultWithDecays


@dataclass(frozen=True, eq=False, kw_only=True)
class DecayResult(ResultWithDecays):
    """The glow after lamp off.

    Attributes
    ----------
    background
        Region whose level was subtracted from each frame; None if dark frames served for that.
    states_requested
        Number of states that was requested; None if the data decided.
    charge_durations_s
        Measured duration of the charge before each decay in seconds.
    temperature_c
        Mean temperature over the photographs of the glow in °C; None if unknown.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, fit in result.fits.items():
    ...     print(name, [f"{rate.value:.4f} ± {rate.sigma:.4f} /s" for rate in fit.rates])
    """

    kind: ClassVar[str] = "decay"

    background: Region | None = None
    states_requested: int | None = None
    charge_durations_s: tuple[float, ...] = ()
    temperature_c: float | None = None
