"""Fit of a mixture to a re-radiation matrix.

Entries above the noise, then components with the least squared error, then the scale (Hua et al.,
*A compact representation for fluorescent spectral data*, EGSR 2021, section 5). Where σ is known
the error is χ² of all entries as they were measured, negative ones too: what a threshold takes for
noise is partly light.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Literal

import numpy as np

from labrig.fit.mixture.candidate import Candidate, candidates, likeliest
from labrig.fit.mixture.entries import (
    FALSE_DISCOVERY_RATE,
    Scaling,
    StokesEntries,
    chi2,
    masked_mse,
    modelled,
    stokes_entries,
    with_colours,
    with_integral,
)
from labrig.fit.mixture.refinement import PARAMETERS, PARAMETERS as SKEWED_PARAMETERS
from labrig.fit.mixture.result import HeldOutError, LightKept, MixtureCandidate, MixtureFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture
from labrig.optics import Spectrum

FOLDS = 5
SEED = 2021


def held_out_errors(entries: StokesEntries, most: int, skewed: bool) -> list[HeldOutError]:
    """Return the errors of 1 to `most` components, each entry predicted from other ones.

    Entries are dealt out by chance to five folds of equal size, always the same.
    """
    deal = np.random.default_rng(SEED).permutation(len(entries.value)) % FOLDS
    by_fold = [list(_errors(entries, deal == fold, most, skewed)) for fold in range(FOLDS)]
    return [
        HeldOutError(float(np.mean(errors)), float(np.std(errors, ddof=1) / np.sqrt(FOLDS)))
        for errors in zip(*by_fold, strict=True)
    ]


def _errors(
    entries: StokesEntries, held_out: np.ndarray, most: int, skewed: bool
) -> Iterator[float]:
    training, test = entries.where(~held_out), entries.where(held_out)
    for candidate in islice(candidates(training, 1, skewed, is_final=False), most):
        off = modelled(test, candidate.mixture) - test.wanted
        yield float(np.average(off**2, weights=test.weight**2))


#: Least part of the light, and least number of its σ, with which a column is compared.
MIN_PART, MIN_SIGMAS = 0.01, 5.0


def light_sigma(matrix: ReradiationMatrix, entries: StokesEntries) -> float | None:
    """Return σ of the light in all entries; None if they are not weighted by σ."""
    sigma = None if entries.sigma is None else _column_sigma(matrix, entries)
    return None if sigma is None else float(np.sqrt(sigma @ sigma))


def light_kept(
    matrix: ReradiationMatrix, entries: StokesEntries, mixture: ReradiationMixture
) -> LightKept:
    """Compare the light of a mixture with that in the entries as they were measured.

    Parameters
    ----------
    matrix
        The matrix, of whose columns errors may correlate.
    entries
        Its entries on the Stokes side.
    mixture
        The mixture.
    """
    measured = _by_column(matrix, entries, entries.measured)
    kept = _by_column(matrix, entries, modelled(entries, mixture))
    sigma = _column_sigma(matrix, entries)
    total = float(measured.sum())
    bright = measured >= MIN_PART * abs(total)
    off = np.abs(kept - measured)
    if sigma is not None:
        bright &= measured >= MIN_SIGMAS * sigma
        off = off / np.where(sigma > 0, sigma, 1.0)
    else:
        off = off / np.where(bright, measured, 1.0)
    parts = np.where(bright, kept / np.where(bright, measured, 1.0), 1.0)
    worst = int(np.argmax(np.where(bright, off, 0.0)))
    part = float(kept.sum()) / total if total > 0 else math.nan
    return LightKept(
        total=part,
        total_sigma=None if sigma is None else part * float(np.sqrt(sigma @ sigma)) / abs(total),
        worst_input_nm=float(matrix.input_nm[worst]),
        worst=float(parts[worst]),
        worst_sigma=None
        if sigma is None or not bright[worst]
        else float(parts[worst] * sigma[worst] / measured[worst]),
    )


def _by_column(matrix: ReradiationMatrix, entries: StokesEntries, values: FloatArray) -> FloatArray:
    """Return the sums over each input band, shape (m,)."""
    column = np.searchsorted(matrix.input_nm, entries.input_nm)
    return np.bincount(column, values, len(matrix.input_nm)) * matrix.input_width_nm


def _column_sigma(matrix: ReradiationMatrix, entries: StokesEntries) -> FloatArray | None:
    """Return σ of the light in each input band, shape (m,); None if that of entries is unknown."""
    if matrix.reradiation_sigma is None:
        return None
    row = np.searchsorted(matrix.output_nm, entries.output_nm)
    column = np.searchsorted(matrix.input_nm, entries.input_nm)
    sigma = np.nan_to_num(matrix.reradiation_sigma[row, column]) * entries.output_width_nm
    independent = _by_column(matrix, entries, sigma**2) * matrix.input_width_nm
    together = _by_column(matrix, entries, sigma) ** 2
    common = matrix.column_correlation if matrix.column_correlation is not None else 0.0
    return np.asarray(np.sqrt((1 - common) * independent + common * together))


Selection = Literal["bic", "cross-validation"]

#: Largest number of components that "auto" tries.
MAX_COMPONENTS = 6
#: Numbers of components in a row without a lower BIC after which "auto" ends.
PATIENCE = 2


def fit_mixture(
    matrix: ReradiationMatrix,
    components: int | Literal["auto"] = "auto",
    scaling: Scaling = "integral",
    threshold: float | None = None,
    *,
    selection: Selection = "bic",
    skewed: bool = False,
    lights: Sequence[Spectrum] = (),
    refine: bool = True,
) -> MixtureFit:
    """Fit a mixture of normal densities to the re-radiation of a matrix.

    Mixture and matrix are compared at the centres of the bands. The same matrix always gives the
    same mixture.

    Parameters
    ----------
    matrix
        The matrix. Its σ, where it is known, weighs the entries.
    components
        Number of components; "auto" takes that which `selection` prefers.
    scaling
        "integral" keeps the amount of light, and so the brightness, as far as the sum of the
        entries tells it better than their fit does; "least-squares" has the least error (equations
        4 and 5 of the paper), "colour" the least mean ΔE2000 under `lights`.
    threshold
        Least value per band that is more than noise: entries below are taken as 0, and all weigh
        the same, as in the paper. Without it all entries are fitted as they are, weighted by σ.
    selection
        "bic" takes the number of the least Bayesian information criterion; "cross-validation" the
        least number whose error at entries left out of the fit is within one standard error of the
        least such error.
    skewed
        Whether each component may be skewed in input and output: two more parameters each.
    lights
        Lights whose colours set the scale if `scaling` is "colour".
    refine
        Whether the squared error is minimised after the likelihood. The likelihood alone, of the
        entries above the noise, is what the paper maximises: ten times faster, with three times the
        error; not for "auto" or skewed components.

    Returns
    -------
    MixtureFit
        The mixture, its error, and how both were found.

    Raises
    ------
    UsageError
        There is neither σ nor a threshold, there are more components than the entries allow, or
        `refine` is left out where it is needed.
    DataError
        No entry is above the threshold.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import ReradiationMixture
    >>> dye = ReradiationMixture(
    ...     20.0, np.ones(1), np.array([[460.0, 520.0]]), np.array([[[900.0, 100], [100, 400]]])
    ... )
    >>> matrix = dye.to_matrix(np.arange(300.0, 781, 10), np.arange(380.0, 781, 10))
    >>> fit = fit_mixture(matrix, components=1, threshold=1e-9)
    >>> fit.mixture.mean_nm.round(3).tolist(), round(fit.mixture.scale, 3)
    ([[460.0, 520.0]], 20.0)
    """
    parameters = SKEWED_PARAMETERS if skewed else PARAMETERS
    entries = stokes_entries(matrix, threshold)
    kept = int(entries.is_kept.sum())
    most = min(kept, len(entries.value) // parameters)
    if not refine and (skewed or components == "auto"):
        raise UsageError("expected a number of normal components for a fit without refinement")
    if components == "auto":
        most = max(min(MAX_COMPONENTS, kept // parameters), 1)
        fits, table = _selected(entries, most, parameters, selection, skewed)
    elif 1 <= components <= most:
        fits = [
            next(candidates(entries, components, skewed))
            if refine
            else likeliest(entries, components)
        ]
        table = [_scored(entries, fits[0], parameters)]
    else:
        raise UsageError(
            f"expected 1 to {most} components for {kept} entries above the threshold, "
            f"got {components}"
        )
    chosen = _preferred(table, selection)
    best = fits[chosen]
    mixture = best.mixture
    if scaling != "least-squares":
        mixture = with_integral(entries, mixture, light_sigma(matrix, entries))
    if scaling == "colour":
        mixture = with_colours(matrix, mixture, lights)
    widths_nm = matrix.output_width_nm
    return MixtureFit(
        mixture=mixture,
        scaling=scaling,
        lights=tuple(light.name for light in lights) if scaling == "colour" else (),
        threshold=entries.threshold,
        false_discovery_rate=FALSE_DISCOVERY_RATE if threshold is None else None,
        kept_entries=kept,
        entries=len(entries.value),
        light_kept=light_kept(matrix, entries, mixture),
        reduced_chi2=table[chosen].reduced_chi2,
        masked_mse=masked_mse(entries, mixture),
        likelihood_mse=best.likelihood_mse,
        band_nm=float(widths_nm[0]) if np.allclose(widths_nm, widths_nm[0]) else 1.0,
        measured_input_nm=(float(matrix.input_edges_nm[0]), float(matrix.input_edges_nm[-1])),
        unit=matrix.unit,
        iterations=best.iterations,
        refinement_iterations=best.refinement_iterations,
        converged=best.converged,
        at_bound=best.at_bound,
        selection=selection if components == "auto" else "given",
        candidates=tuple(table),
    )


def _selected(
    entries: StokesEntries, most: int, parameters: int, selection: Selection, skewed: bool
) -> tuple[list[Candidate], list[MixtureCandidate]]:
    """Return fits of 1 component and more, as many as the choice among them needs."""
    held_out: Sequence[HeldOutError | None] = [None] * most
    if selection == "cross-validation":
        held_out = held_out_errors(entries, most, skewed)
    fits: list[Candidate] = []
    table: list[MixtureCandidate] = []
    for fit, error in zip(islice(candidates(entries, 1, skewed), most), held_out, strict=True):
        fits.append(fit)
        table.append(_scored(entries, fit, parameters, error))
        if selection == "bic" and len(table) - 1 - _preferred(table, selection) >= PATIENCE:
            break
    return fits, table


def _scored(
    entries: StokesEntries, fit: Candidate, parameters: int, held_out: HeldOutError | None = None
) -> MixtureCandidate:
    components = len(fit.mixture.weights)
    mse = masked_mse(entries, fit.mixture)
    misfit, number = chi2(entries, fit.mixture), len(entries.value)
    reduced = None if misfit is None else misfit / max(number - parameters * components, 1)
    if misfit is None:
        number = int(entries.is_kept.sum())
        misfit = number * float(np.log(max(mse, np.finfo(np.float64).tiny)))
    bic = misfit + parameters * components * float(np.log(number))
    return MixtureCandidate(components, mse, bic, reduced, held_out)


def _preferred(table: Sequence[MixtureCandidate], selection: Selection) -> int:
    """Return the place of the number of components that is chosen."""
    held_out = [row.held_out for row in table if row.held_out is not None]
    if selection == "bic" or not held_out:
        return min(range(len(table)), key=lambda place: table[place].bic)
    least = min(held_out, key=lambda error: error.mse)
    limit = least.mse + least.standard_error
    return next(place for place, error in enumerate(held_out) if error.mse <= limit)
