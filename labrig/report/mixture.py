"""A mixture beside the re-radiation matrix for which it stands: as text, and as JSON."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labrig.fit import LightKept, MixtureCandidate, MixtureFit
from labrig.foundation.number_format import aligned, rounded
from labrig.foundation.result_warning import ResultWarning, Undetermined, warning_lines
from labrig.material import (
    REFERENCE_Y,
    ColourDifference,
    ReradiationMatrix,
    compare_colours,
)
from labrig.optics import Spectrum
from labrig.results import with_uncertainty

#: How the number of components was found, by `MixtureFit.selection`.
SELECTIONS = {"given": "as asked for", "bic": "by BIC", "cross-validation": "by cross-validation"}


@dataclass(frozen=True, eq=False)
class FittedMatrix:
    """A matrix, the mixture that stands for it, and lights under which both are compared.

    Attributes
    ----------
    matrix
        The matrix to which the mixture was fitted.
    fit
        The fitted mixture.
    lights
        Irradiances per nm; their colours are of no use if the re-radiation is relative.
    others
        Fits with other numbers of components, beside those that the fit itself compared.
    """

    matrix: ReradiationMatrix
    fit: MixtureFit
    lights: tuple[Spectrum, ...] = ()
    others: tuple[MixtureCandidate, ...] = ()

    @property
    def candidates(self) -> tuple[MixtureCandidate, ...]:
        """All fits by their number of components, the fit's own where there are two."""
        by_number = {tried.components: tried for tried in (*self.others, *self.fit.candidates)}
        return tuple(by_number[number] for number in sorted(by_number))

    @cached_property
    def model(self) -> ReradiationMatrix:
        """The mixture on the matrix's bands, with the measured reflectance."""
        matrix = self.matrix
        return self.fit.mixture.to_matrix(
            matrix.input_nm, matrix.output_nm, reflectance=matrix.reflectance, name=matrix.name
        )

    @cached_property
    def differences(self) -> tuple[ColourDifference, ...]:
        """Differences of the mixture's colours from the matrix's; none of relative re-radiation."""
        if self.matrix.unit == "relative":
            return ()
        return tuple(compare_colours(self.model, self.matrix, self.lights))

    def to_json(self) -> str:
        """Return the text of `fit.json`: the fit, and under `colours` the differences."""
        colours = [difference.to_dict() for difference in self.differences]
        content = {**self.fit.to_dict(), "colours": colours}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


def describe_mixture(fitted: FittedMatrix) -> str:
    """Describe a mixture in lines of text.

    Parameters
    ----------
    fitted
        The matrix and its mixture.

    Returns
    -------
    str
        A line for each component, the errors and how the number of components was found.

    Examples
    --------
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_reradiation
    >>> from labrig.report import FittedMatrix, describe_mixture
    >>> paper = read_reradiation("paper.csv")
    >>> fitted = FittedMatrix(paper, fit_mixture(paper, 2, threshold=1e-3))
    >>> print(describe_mixture(fitted).splitlines()[0])
    yellow paper: 2 components, as asked for
    """
    fit = fitted.fit
    lines = [f"{fitted.matrix.name}: {components_text(fit)}, {selection_text(fit)}"]
    lines += [f"  {line}" for line in aligned([component_head(fit), *component_rows(fit)])]
    lines += [
        f"  threshold     {threshold_text(fit)}",
        f"  {_error_line(fit)} (scale by {fit.scaling})",
        f"  light kept    {light_kept_text(fit.light_kept)}",
    ]
    if fit.selection == "bic":
        criteria = (f"{tried.components}: {tried.bic:.0f}" for tried in fit.candidates)
        lines.append(f"  BIC           {', '.join(criteria)}")
    if fit.selection == "cross-validation":
        errors = (f"{number}: {rounded(mse, 3)}" for number, mse in held_out_errors(fit.candidates))
        lines.append(f"  held-out MSE  {', '.join(errors)}")
    lines += warning_lines(mixture_warnings(fit), "  ! ")
    if fitted.differences:
        lines += [f"  {line}" for line in difference_lines(fitted.differences)]
    return "\n".join(lines)


def _error_line(fit: MixtureFit) -> str:
    if fit.reduced_chi2 is None:
        return f"masked MSE    {rounded(fit.masked_mse, 3)} per band²"
    return f"reduced χ²    {rounded(fit.reduced_chi2, 3)}"


def light_kept_text(kept: LightKept) -> str:
    """Return how much of the measured light a mixture re-radiates, in all and of one column."""
    total, worst = (
        f"{part:.3f}" if sigma is None else with_uncertainty(part, sigma)
        for part, sigma in ((kept.total, kept.total_sigma), (kept.worst, kept.worst_sigma))
    )
    return f"{total} of all that was measured; worst at {kept.worst_input_nm:g} nm, {worst}"


def mixture_warnings(fit: MixtureFit) -> tuple[ResultWarning, ...]:
    """Return a warning about a fit that did not end at a minimum."""
    if fit.converged:
        return ()
    return (Undetermined("fit-unconverged", "the refinement ended before it reached a minimum"),)


def component_head(fit: MixtureFit) -> tuple[str, ...]:
    """Return the heads of the columns of `component_rows`."""
    head = ("weight", "incident / nm", "returning / nm", "σ / nm", "correlation")
    skew = () if fit.mixture.skew is None else ("skew",)
    return (*head, *skew, *(("at its bound",) if fit.at_bound else ()))


def held_out_errors(candidates: Sequence[MixtureCandidate]) -> list[tuple[int, float]]:
    """Return number of components and mean squared error of what was left out of the fit."""
    return [
        (tried.components, tried.held_out.mse) for tried in candidates if tried.held_out is not None
    ]


def component_rows(fit: MixtureFit) -> Iterator[tuple[str, ...]]:
    """Yield weight, means, standard deviations, correlation and skews of each component.

    The names of what a bound holds follow, where one does.
    """
    mixture = fit.mixture
    components = zip(
        mixture.weights, mixture.mean_nm, mixture.covariance_nm2, mixture.skews, strict=True
    )
    for number, (weight, mean, covariance, skew) in enumerate(components, start=1):
        held = ", ".join(name for own, name in fit.at_bound if own == number)
        sd = np.sqrt(np.diag(covariance))
        yield (
            f"{weight:.3f}",
            f"{mean[0]:.1f}",
            f"{mean[1]:.1f}",
            f"{sd[0]:.1f}, {sd[1]:.1f}",
            f"{covariance[0, 1] / sd.prod():+.2f}",
            *(() if mixture.skew is None else (f"{skew[0]:+.2f}, {skew[1]:+.2f}",)),
            *((held,) if fit.at_bound else ()),
        )


def components_text(fit: MixtureFit) -> str:
    """Return the number of components."""
    return f"{fit.components} component{'' if fit.components == 1 else 's'}"


def selection_text(fit: MixtureFit) -> str:
    """Return how the number of components was found."""
    return SELECTIONS.get(fit.selection, f"by {fit.selection}")


def threshold_text(fit: MixtureFit) -> str:
    """Return the threshold, how it was found and what it keeps."""
    rate = (
        "given"
        if fit.false_discovery_rate is None
        else f"{100 * fit.false_discovery_rate:g} % of the kept numbers are noise"
    )
    return (
        f"{rounded(fit.threshold, 3)} per band, {rate}; {fit.kept_entries} of {fit.entries} "
        "numbers kept"
    )


def difference_lines(differences: Sequence[ColourDifference]) -> Iterator[str]:
    """Yield a table of colour differences, line by line.

    Parameters
    ----------
    differences
        Differences under one light each.

    Yields
    ------
    str
        The head, then a line for each light.

    Examples
    --------
    >>> from labrig.material import ColourDifference
    >>> from labrig.report import difference_lines
    >>> for line in difference_lines([ColourDifference("D65", "light", 0.5, 0.01)]):
    ...     print(line)
    light         ΔE2000   XYZ error  white
    D65             0.50      1.00 %  under the light
    """
    yield f"{'light':12}{'ΔE2000':>8}{'XYZ error':>12}  white"
    for difference in differences:
        if np.isnan(difference.xyz_error):
            yield f"{difference.light:12}{'–':>8}{'–':>12}  the reference is black"
            continue
        yield (
            f"{difference.light:12}{difference.delta_e:8.2f}{100 * difference.xyz_error:10.2f} %  "
            f"{white_text(difference)}"
        )


def white_text(difference: ColourDifference) -> str:
    """Return the white of a colour difference."""
    if difference.white == "light":
        return "under the light"
    return f"D65, the reference at Y = {100 * REFERENCE_Y:g} %"
