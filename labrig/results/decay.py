"""What a decay run found: of every patch its values over time and the fit to them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from labrig.material import Material, write_material
from labrig.region import Region
from labrig.results.fitted_decay import FittedDecay, write_fitted_decay
from labrig.results.measured import FloatArray
from labrig.results.run_result import RunResult
from labrig.results.series import Series, write_series


@dataclass(frozen=True, eq=False)
class NoiseBudget:
    """Standard uncertainties of the brightest channel, relative to its fitted signal.

    Attributes
    ----------
    t_s
        (n,) middle of the exposures of the first decay, rising.
    photons, reading, uneven
        (n,) what grows as the root of the light, what is there without light, and what is
        proportional to it but differs over the patch. Their sum in quadrature is the series' σ.
    flicker
        (n,) common to the channels of a frame, as fitted.
    dark_level
        (n,) of the level that was subtracted, common to all frames; 0 if not known.
    """

    t_s: FloatArray
    photons: FloatArray
    reading: FloatArray
    uneven: FloatArray
    flicker: FloatArray
    dark_level: FloatArray

    @property
    def together(self) -> FloatArray:
        """Of one value, (n,)."""
        parts = (self.photons, self.reading, self.uneven, self.flicker, self.dark_level)
        return np.asarray(np.sqrt(np.square(parts).sum(axis=0)))


@dataclass(frozen=True, eq=False, kw_only=True)
class DecayPatch:
    """One patch of the sample.

    Attributes
    ----------
    region
        Where it lies in the photographs; None if that is not known.
    series
        What was measured there, DN/s.
    fit
        None where nothing could be fitted.
    failure
        Why there is no fit; empty if there is one.
    normalised_residuals
        (m, C) value − model of the m usable frames, whitened: independent and of unit variance if
        the noise is as assumed. None without a fit.
    noise
        Where σ comes from; None where the fitted frames do not tell.
    material
        What the decay alone says of it, rates and amplitudes; None without a fit.
    """

    region: Region | None
    series: Series
    fit: FittedDecay | None = None
    failure: str = ""
    normalised_residuals: FloatArray | None = None
    noise: NoiseBudget | None = None
    material: Material | None = None

    def write_files(self, folder: Path) -> None:
        """Write `series.csv` and, where there is a fit, `fit.json` and `material.yaml`."""
        folder.mkdir(exist_ok=True)
        write_series(folder / "series.csv", [self.series])
        if self.fit is not None:
            write_fitted_decay(folder / "fit.json", self.fit)
        if self.material is not None:
            write_material(folder / "material.yaml", self.material)


@dataclass(frozen=True, eq=False, kw_only=True)
class DecayResult(RunResult):
    """The glow after lamp off.

    Attributes
    ----------
    patches
        By name.
    background
        The region whose level was subtracted from each frame; None if dark frames served for that.
    states_asked
        The number of states that was asked for; None if the data decided.
    charges_s
        How long the lamp shone before each decay, as measured.
    temperature_c
        Mean over the photographs of the glow; None where it is not known.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, fit in result.fits.items():
    ...     print(name, [f"{rate.value:.4f} ± {rate.sigma:.4f} /s" for rate in fit.rates])
    """

    kind: ClassVar[str] = "decay"

    patches: Mapping[str, DecayPatch]
    background: Region | None = None
    states_asked: int | None = None
    charges_s: tuple[float, ...] = ()
    temperature_c: float | None = None

    @property
    def fits(self) -> dict[str, FittedDecay]:
        """Of the patches that could be fitted, by name."""
        return {name: one.fit for name, one in self.patches.items() if one.fit is not None}

    def provides(self) -> dict[str, dict[str, FittedDecay]]:
        """The fits, by patch."""
        return {"decays": self.fits}

    def failures(self) -> tuple[str, ...]:
        """Why no patch at all could be fitted."""
        return () if self.fits else tuple(one.failure for one in self.patches.values())

    def write_files(self, folder: Path) -> None:
        """Write what belongs to each patch; of several, each into a folder of its name."""
        for name, patch in self.patches.items():
            patch.write_files(folder / name if len(self.patches) > 1 else folder)
