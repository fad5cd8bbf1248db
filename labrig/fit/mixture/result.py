"""The result of a fit of a mixture to a re-radiation matrix."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from labrig.foundation.notebook_views import NotebookViews
from labrig.material import ReradiationMixture


@dataclass(frozen=True)
class HeldOutError:
    """Error of a mixture at entries that it was not fitted to.

    Attributes
    ----------
    mse
        Mean squared error per band.
    standard_error
        Its standard error, from the scatter among the folds.
    """

    mse: float
    standard_error: float


@dataclass(frozen=True)
class LightKept:
    """Light that a mixture re-radiates over that in the measured entries, all of them counted.

    Attributes
    ----------
    total, total_sigma
        Of the whole matrix, and its σ from that of the entries; None without it. NaN if the
        entries have no light in the mean.
    worst_input_nm, worst, worst_sigma
        The input band with 1 % of the light or more, known to 5 σ, whose light is kept worst: by
        most of its σ, or by most of its light where σ is unknown.
    """

    total: float
    total_sigma: float | None
    worst_input_nm: float
    worst: float
    worst_sigma: float | None


@dataclass(frozen=True)
class MixtureCandidate:
    """A fit with some number of components.

    Attributes
    ----------
    components
        Number K of components.
    masked_mse
        As `MixtureFit.masked_mse`, by least squares.
    bic
        Bayesian information criterion, P = 6 (8 if skewed): χ² + P K ln N of N entries weighted by
        σ; else M ln(masked_mse) + P K ln M of the M entries above the threshold, since entries
        that were set to zero are no data.
    reduced_chi2
        χ² over N − P K; None without σ. Above 1 by more than a few √(2/N) it is misfit, not noise.
    held_out
        Error at entries that were left out of the fit, by five-fold cross-validation; None without
        it.
    """

    components: int
    masked_mse: float
    bic: float
    reduced_chi2: float | None = None
    held_out: HeldOutError | None = None


@dataclass(frozen=True, eq=False)
class MixtureFit(NotebookViews):
    """A mixture that stands for a re-radiation matrix.

    Attributes
    ----------
    mixture
        The mixture.
    scaling
        "integral" if the mixture re-radiates as much as the entries do (all of them if they are
        weighted by σ, else those above the threshold), "least-squares" if its scale minimises the
        error, "colour" if it minimises ΔE2000.
    lights
        Names of the lights under which it does; none otherwise.
    threshold
        Least value per band that counted as re-radiation.
    false_discovery_rate
        Rate by which that was found; None if the threshold was given.
    kept_entries, entries
        Number of entries above the threshold, and of all measured ones with λ_o > λ_i.
    light_kept
        Light of the mixture over that measured.
    reduced_chi2
        χ² of all entries over their number less that of the parameters, with the scale of least
        squares; None if they are not weighted by σ.
    masked_mse
        Mean squared error, per band, of all measured entries with λ_o > λ_i, those below the
        threshold taken as 0.
    likelihood_mse
        The same before refinement, of expectation maximisation alone.
    band_nm
        Width of the output bands in nm; 1 if they differ.
    measured_input_nm
        Ends in nm of the incident light that the matrix has; beyond are only tails of densities.
    unit
        Unit of the re-radiation, `1/nm` or `relative`.
    iterations, refinement_iterations
        Number of iterations of expectation maximisation and of the refinement.
    converged
        Whether the refinement reached a minimum.
    at_bound
        Numbers of components, from 1, and names of their parameters that are at the bounds of the
        search: a mean at the end of the measured wavelengths is no peak that was seen.
    selection
        How the number of components was found: "bic", "cross-validation" or "given".
    candidates
        The numbers of components that were tried.
    """

    mixture: ReradiationMixture
    scaling: str
    lights: tuple[str, ...]
    threshold: float
    false_discovery_rate: float | None
    kept_entries: int
    entries: int
    light_kept: LightKept
    reduced_chi2: float | None
    masked_mse: float
    likelihood_mse: float
    band_nm: float
    measured_input_nm: tuple[float, float]
    unit: str
    iterations: int
    refinement_iterations: int
    converged: bool
    at_bound: tuple[tuple[int, str], ...]
    selection: str
    candidates: tuple[MixtureCandidate, ...]

    @property
    def components(self) -> int:
        """Number of components."""
        return len(self.mixture.weights)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `fit.json`.

        Its `scale` is that of a band: re-radiation in an output band of `band_nm` is `scale` times
        the density in 1/nm² on the Stokes side.
        """
        mixture = self.mixture
        return {
            "scale": mixture.scale * self.band_nm,
            "band_nm": self.band_nm,
            "unit": self.unit,
            "measured_input_nm": list(self.measured_input_nm),
            "components": [
                {
                    "weight": float(weight),
                    "mean": mean.tolist(),
                    "covariance": covariance.tolist(),
                    **({} if mixture.skew is None else {"skew": skew.tolist()}),
                }
                for weight, mean, covariance, skew in zip(
                    mixture.weights,
                    mixture.mean_nm,
                    mixture.covariance_nm2,
                    mixture.skews,
                    strict=True,
                )
            ],
            "scaling": self.scaling,
            "lights": list(self.lights),
            "threshold": self.threshold,
            "false_discovery_rate": self.false_discovery_rate,
            "kept_entries": self.kept_entries,
            "entries": self.entries,
            "light_kept": asdict(self.light_kept),
            "reduced_chi2": self.reduced_chi2,
            "masked_mse": self.masked_mse,
            "likelihood_mse": self.likelihood_mse,
            "iterations": self.iterations,
            "refinement_iterations": self.refinement_iterations,
            "converged": self.converged,
            "at_bound": [
                {"component": number, "parameter": name} for number, name in self.at_bound
            ],
            "selection": self.selection,
            "candidates": [asdict(candidate) for candidate in self.candidates],
        }

    def to_json(self) -> str:
        """Return the text of `fit.json`."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
