"""Decay of one patch: its series, fit, noise and material."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.output_file import make_folder
from labrig.foundation.region import Region
from labrig.material import Material, write_material
from labrig.results.budget import Budget, named
from labrig.results.fitted_decay import FittedDecay
from labrig.results.fitted_decay_file import write_fitted_decay
from labrig.results.fitted_law import EXPONENTIALS
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult, in_folders
from labrig.results.series import Series


@dataclass(frozen=True, eq=False)
class NoiseBudget:
    """Standard uncertainties of the brightest channel, relative to its fitted signal.

    Attributes
    ----------
    t_s
        Middles of the exposures of the first decay in seconds after lamp off, rising, shape (n,).
    photon, read, uneven
        Photon noise, read noise, and the part that is proportional to the light but uneven over the
        patch, shape (n,). Their sum in quadrature is the series' σ.
    flicker
        Fitted scatter common to the channels of a frame, shape (n,).
    dark_level
        Uncertainty of the subtracted dark level, common to all frames, shape (n,); 0 if unknown.
    """

    t_s: FloatArray
    photon: FloatArray
    read: FloatArray
    uneven: FloatArray
    flicker: FloatArray
    dark_level: FloatArray

    @property
    def total(self) -> FloatArray:
        """Total relative standard uncertainty of one value, shape (n,)."""
        parts = (self.photon, self.read, self.uneven, self.flicker, self.dark_level)
        return np.asarray(np.sqrt(np.square(parts).sum(axis=0)))


@dataclass(frozen=True, eq=False, kw_only=True)
class DecayPatch(NotebookViews):
    """Decay of one patch of the sample.

    Attributes
    ----------
    region
        Region of the patch in the photographs; None if unknown.
    series
        Time series of the patch in DN/s.
    fit
        Fitted decay; None where the fit failed.
    failure
        Reason for the missing fit; empty if there is one.
    normalised_residuals
        Value − model of the m usable frames, whitened: independent and of unit variance if the
        noise is as assumed, shape (m, C). None without a fit.
    noise
        Noise budget; None where the fitted frames do not determine it.
    material
        Material by this decay alone, with rates and amplitudes; None without a fit.
    drift_effect
        Relative changes of rate and amplitude of every state, by falling rate, if the room had
        warmed by 1 K in an hour while the sample glowed, traps being 0.65 eV deep, shape (n, 2).
        None where the temperature was recorded, without a fit, or by a law without states.
    """

    region: Region | None
    series: Series
    fit: FittedDecay | None = None
    failure: str = ""
    normalised_residuals: FloatArray | None = None
    noise: NoiseBudget | None = None
    material: Material | None = None
    drift_effect: FloatArray | None = None

    def budgets(self, name: str) -> Iterator[tuple[str, Budget]]:
        """Yield the budgets of rates and amplitudes, or of the parameters of another law.

        A state that goes unseen is their range by model, where its size is known. The calibrations
        that matter are those of times, and of the camera's linearity: neither is in σ.
        """
        fit = self.fit
        if fit is None:
            return
        missing = ("temperature",) if self.drift_effect is not None else ()
        if fit.law != EXPONENTIALS:
            for parameter, value in fit.parameters.items():
                yield named(name, parameter), Budget.of(value, left_out=missing)
            return
        unit = self.series.value_unit
        unseen = fit.unseen_state
        for number, state in enumerate(fit.states):
            quantities = (
                ("k_r", Measured(state.k_r_per_s, state.k_r_per_s_sigma, "1/s"), "rate_changes"),
                (
                    "amplitude",
                    Measured(state.amplitude, state.amplitude_sigma, unit),
                    "amplitude_changes",
                ),
            )
            for quantity, stated, changes in quantities:
                change = (
                    abs(getattr(unseen, changes)[number]) * abs(stated.value) if unseen else 0.0
                )
                ends = (stated.value - change, stated.value + change)
                yield (
                    named(name, f"{quantity} of state {number + 1}"),
                    Budget.of(
                        stated,
                        model_range=ends if unseen else None,
                        model_of="a state that goes unseen" if unseen else "",
                        left_out=missing,
                    ),
                )

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `series.csv`."""
        return self.series.csv_tables()

    def write_files(self, folder: Path) -> None:
        """Write, where there is a fit, `fit.json` and `material.yaml`."""
        make_folder(folder)
        if self.fit is not None:
            write_fitted_decay(folder / "fit.json", self.fit)
        if self.material is not None:
            write_material(folder / "material.yaml", self.material)


@dataclass(frozen=True, eq=False, kw_only=True)
class ResultWithDecays(RunResult):
    """Base of the results that are decays of patches.

    Attributes
    ----------
    patches
        Decay of each patch by its name.
    """

    patches: Mapping[str, DecayPatch]

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

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table of each patch; of several patches, each in a folder of its name."""
        tables = {name: patch.csv_tables() for name, patch in self.patches.items()}
        return in_folders(tables) if len(tables) > 1 else next(iter(tables.values()), {})

    def write_files(self, folder: Path) -> None:
        """Write the files of each patch; of several patches, each into a folder of its name."""
        for name, patch in self.patches.items():
            patch.write_files(folder / name if len(self.patches) > 1 else folder)
