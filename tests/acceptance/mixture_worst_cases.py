"""Materials whose mixtures are furthest from them in colour: numbers and a picture that say why."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from labrig.material import ReradiationMatrix, compare_colours
from labrig.optics import Spectrum, read_light
from labrig.report.figure_style import CHANNEL, INK, MUTED, PAPER, figure_style
from tests.acceptance.mixture_judgement import Pair, another_day, with_values
from tests.acceptance.mixture_peer_methods import Target, mixture_values

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

WORST, LIGHTS = 3, ("450nm", "395nm")
COMPONENTS, MORE_COMPONENTS = 4, 6


@dataclass(frozen=True, eq=False)
class Case:
    """One material under one light, in which its mixture is far from it.

    Attributes
    ----------
    delta_e
        ΔE2000 of the mixture, of a mixture of more components, of the thresholded matrix, against
        the measured matrix; then of the mixture against the thresholded matrix.
    repeats
        Median and 90th percentile of ΔE2000 between two days' measurements.
    fractions
        Part of the light that is re-radiated: measured, its σ, above the threshold, by the mixture.
    """

    target: Target
    light: Spectrum
    values: Floats
    delta_e: tuple[float, float, float, float]
    repeats: tuple[float, float]
    fractions: tuple[float, float, float, float]


def worst_cases(targets: Sequence[Target], pairs: Sequence[Pair]) -> list[Case]:
    """Return the materials of the largest ΔE2000 under each narrow light, the worst first."""
    cases = []
    values = [mixture_values(target, COMPONENTS) for target in targets]
    for light in map(read_light, LIGHTS):
        found = [
            delta_e(with_values(target.matrix, mixed), target.matrix, light)
            for target, mixed in zip(targets, values, strict=True)
        ]
        for index in np.argsort(-np.nan_to_num(found))[:WORST]:
            cases.append(_case(targets[index], values[index], light, pairs))
    return cases


def print_worst_cases(cases: Sequence[Case]) -> None:
    """Print a line for each case."""
    print(f"\n{'':22}{'ΔE2000 of':>12}{f'of {MORE_COMPONENTS} com-':>11}{'threshold':>11}"
          f"{'mixture to':>13}{'another day':>14}"
          f"{'part of the light re-radiated':>34}")  # fmt: skip
    print(f"{f'worst, {COMPONENTS} components':22}{'mixture':>12}{'ponents':>11}{'alone':>11}"
          f"{'thresholded':>13}{'median, 90 %':>14}{'measured':>18}{'kept':>9}"
          f"{'mixture':>9}")  # fmt: skip
    for case in cases:
        mixture, more, alone, against = case.delta_e
        measured, sigma, kept, mixed = case.fractions
        print(f"{case.target.matrix.name:14}{case.light.name:8}{mixture:12.1f}{more:11.1f}"
              f"{alone:11.1f}{against:13.1f}{case.repeats[0]:8.1f}{case.repeats[1]:6.1f}"
              f"{measured:10.3f} ± {sigma:.3f}{kept:9.3f}{mixed:9.3f}")  # fmt: skip


def draw_worst_cases(cases: Sequence[Case], path: Path) -> None:
    """Draw, for each case, what comes back of the light: measured, and by the mixture."""
    from matplotlib.figure import Figure

    with figure_style():
        figure = Figure(figsize=(9.0, 5.6), layout="constrained")
        for axes, case in zip(
            figure.subplots(len(LIGHTS), WORST, sharex=True).flat, cases, strict=True
        ):
            _draw(axes, case)
        axes_of = figure.axes
        for axes in axes_of[::WORST]:
            axes.set_ylabel("% of the light per 10 nm")
        for axes in axes_of[-WORST:]:
            axes.set_xlabel("returning wavelength / nm")
        handles, labels = axes_of[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        figure.savefig(path, dpi=110)


def delta_e(surface: ReradiationMatrix, reference: ReradiationMatrix, light: Spectrum) -> float:
    (found,) = compare_colours(surface, reference, [light])
    return found.delta_e


def _case(target: Target, values: Floats, light: Spectrum, pairs: Sequence[Pair]) -> Case:
    matrix = target.matrix
    mixture, thresholded = with_values(matrix, values), with_values(matrix, target.values)
    more = with_values(matrix, mixture_values(target, MORE_COMPONENTS))
    again = [delta_e(another_day(matrix, pair), matrix, light) for pair in pairs]
    part = _parts(matrix, light)
    sigma = matrix.reradiated_fraction_sigma
    assert sigma is not None
    return Case(
        target,
        light,
        values,
        (
            delta_e(mixture, matrix, light),
            delta_e(more, matrix, light),
            delta_e(thresholded, matrix, light),
            delta_e(mixture, thresholded, light),
        ),
        (float(np.nanmedian(again)), float(np.nanquantile(again, 0.9))),
        (
            float(part @ matrix.reradiated_fraction),
            float(np.sqrt(part**2 @ sigma**2)),
            float(part @ thresholded.reradiated_fraction),
            float(part @ mixture.reradiated_fraction),
        ),
    )


def _parts(matrix: ReradiationMatrix, light: Spectrum) -> Floats:
    """Return which part of the light is in each input band."""
    power = light.in_bands(matrix.input_edges_nm) * matrix.input_width_nm
    return np.asarray(power / power.sum())


def _draw(axes: "Axes", case: Case) -> None:
    matrix = case.target.matrix
    part = _parts(matrix, case.light)
    assert matrix.reradiation_sigma is not None
    width = 100 * matrix.output_width_nm
    stokes = matrix.is_stokes[:, part > 0].all(axis=1)
    nm = matrix.output_nm[stokes]
    measured = (np.where(matrix.is_stokes, matrix.reradiation, 0.0) @ part * width)[stokes]
    sigma = (np.sqrt(matrix.reradiation_sigma**2 @ part**2) * width)[stokes]
    is_kept = (case.target.values @ part)[stokes] > 0
    axes.axhline(0, color=MUTED, linewidth=0.7)
    for shown, face, label in (
        (~is_kept, PAPER, "measured, ± 1 σ, below the threshold"),
        (is_kept, INK, "above it"),
    ):
        axes.errorbar(nm[shown], measured[shown], sigma[shown], fmt="o", color=INK, markersize=3,
                      markerfacecolor=face, markeredgewidth=0.7, elinewidth=0.7,
                      label=label)  # fmt: skip
    axes.plot(nm, (100 * case.values @ part)[stokes], color=CHANNEL["R"], linewidth=1.4,
              label=f"mixture of {COMPONENTS} components")  # fmt: skip
    apart, days = f"{case.delta_e[0]:.1f}", f"{case.repeats[0]:.1f}"
    axes.set_title(
        f"{matrix.name} under {case.light.name.replace('nm', ' nm')}: ΔE {apart}\n"
        f"two days {days}, fit alone {case.delta_e[3]:.1f}",
        fontsize="small", color=INK,
    )  # fmt: skip
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
