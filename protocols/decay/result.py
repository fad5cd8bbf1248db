"""Result of a decay run: the time series of every patch and the fit to it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from labrig.foundation.region import Region
from labrig.results.budget import Budget
from labrig.results.decay_patch import DecayPatch
from labrig.results.fitted_decay import FittedDecay
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class DecayResult(RunResult):
    """The glow after lamp off.

    Attributes
    ----------
    patches
        Decay of each patch by its name.
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

    patches: Mapping[str, DecayPatch]
    background: Region | None = None
    states_requested: int | None = None
    charge_durations_s: tuple[float, ...] = ()
    temperature_c: float | None = None

    @property
    def fits(self) -> dict[str, FittedDecay]:
        """Fits of the patches that could be fitted, by name."""
        return {name: patch.fit for name, patch in self.patches.items() if patch.fit is not None}

    def provides(self) -> dict[str, dict[str, FittedDecay]]:
        """Return the fits by patch."""
        return {"decays": self.fits}

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of rates and amplitudes of every patch."""
        several = len(self.patches) > 1
        return {
            quantity: budget
            for name, patch in self.patches.items()
            for quantity, budget in patch.budgets(name if several else "")
        }

    def failures(self) -> tuple[str, ...]:
        """Return the reasons why no patch at all could be fitted."""
        return () if self.fits else tuple(patch.failure for patch in self.patches.values())

    def write_files(self, folder: Path) -> None:
        """Write the files of each patch; of several patches, each into a folder of its name."""
        for name, patch in self.patches.items():
            patch.write_files(folder / name if len(self.patches) > 1 else folder)
