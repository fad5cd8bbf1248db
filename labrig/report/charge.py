"""Page of a fit to charge and decay of one series of readings."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from labrig.fit import ChargeFit
from labrig.foundation.arrays import FloatArray
from labrig.record import RunDescription
from labrig.report.chart import (
    Axis,
    Band,
    Chart,
    ErrorBars,
    Line,
    Margins,
    Mark,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.figure_style import INK, MUTED, OTHER_CHANNELS, SHADE
from labrig.report.page import Report
from labrig.report.parameters import interval_tables
from labrig.report.sections import Picture, Section, Table

#: Largest number of points of each part; more readings are averaged.
MAX_POINTS = 150
#: Range of the residuals' axis in σ, and half width of its shade.
FARTHEST, SHADED = 10.0, 2.0
HEIGHT_PT, RESIDUALS_PT = 330.0, 118.0
#: Decades of light that a logarithmic axis shows at most.
MAX_DECADES = 5.0


def charge_report(fit: ChargeFit, about: RunDescription) -> Report:
    """Return the report of a fit to charge and decay.

    Parameters
    ----------
    fit
        The fit.
    about
        Description of the table and of the processing.

    Returns
    -------
    Report
        States, figures of charge and decay with residuals, and the models that were compared.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_charge_and_decay
    >>> from labrig.record import RunDescription
    >>> from labrig.report import charge_report
    >>> t_s = np.arange(1.0, 300.0, 2.0)
    >>> light = np.where(t_s < 100, 1 - np.exp(-t_s / 30), np.exp(-(t_s - 100) / 30))
    >>> light += 1e-3 * np.random.default_rng(1).standard_normal(len(t_s))
    >>> fit = fit_charge_and_decay(
    ...     t_s, light, 1e-3, light_on_s=0, light_off_s=100, states=1, order="first",
    ...     light_stimulated=0
    ... )
    >>> about = RunDescription(
    ...     title="glow", protocol="charge", run="glow.csv", started="", ended="", rig="",
    ...     simulated=False, labrig_version="0.1.0"
    ... )
    >>> [section.title for section in charge_report(fit, about).sections]
    ['States', 'Charge and decay', 'Models']
    """
    return Report(
        about, fit.warnings, (_states(fit), _figures(fit), _models(fit)), (_methods(fit),)
    )


def _states(fit: ChargeFit) -> Section:
    head, *rows = fit.state_rows()
    text = (
        f"{fit.candidates[fit.chosen].label}, after {fit.charge_s:g} s of charge. χ² per reading "
        f"is {fit.chi2_charge:.2f} in the charge ({fit.n_charge} readings) and "
        f"{fit.chi2_decay:.2f} in the decay ({fit.n_decay})."
    )
    caption = (
        "b: kinetic order; amplitude at lamp off in the unit of the values; p/τ: rate by which the "
        "light falls at lamp off. After this charge each state glows as (1 + t/τ)^(−p), or as "
        "exp(−t/τ) where b is held at 1; where b is not above 1 by more than 2 σ, the rate alone "
        "is determined. Digits in brackets are σ in units of the last places; < and >: at a bound "
        "of what is possible, limit of 95 % probability; – is not determined."
    )
    common = (
        ("fraction η of carriers that recombine at filled traps", str(fit.light_stimulated)),
        ("prompt light, with the lamp on only", str(fit.prompt)),
        ("dark level", str(fit.dark)),
    )
    return Section(
        "States",
        (text,),
        tables=(
            _table(head, rows, caption),
            *interval_tables(fit.named_intervals),
            Table(("of all states", "value"), common),
        ),
    )


def _models(fit: ChargeFit) -> Section:
    head, *rows = fit.model_rows()
    caption = (
        "χ² per reading; ΔBIC: Bayesian information criterion above the lowest, with the noise "
        "enlarged to the misfit of the best model. * was taken: a model with more parameters has "
        "to be better by 6."
    )
    return Section("Models", tables=(_table(head, rows, caption),))


def _table(head: list[str], rows: list[list[str]], caption: str) -> Table:
    return Table(tuple(head), tuple(tuple(row) for row in rows), caption)


def _methods(fit: ChargeFit) -> Section:
    points = (
        "Each state obeys dr/dt = (1 − r) κ − k rᵇ and emits Λ (k rᵇ + η κ r) under the lamp, "
        "Λ k rᵇ in the dark (May and Partridge, J. Chem. Phys. 40, 1964).",
        "Readings while the lamp switches are left out; readings before the lamp determine the "
        "dark level.",
        *(
            (
                "Sums of neighbouring residuals exceed noise: every σ is multiplied by "
                f"{np.sqrt(fit.misfit):.1f}.",
            )
            if fit.misfit > 1
            else ()
        ),
    )
    return Section("How it was found", points=points)


def _figures(fit: ChargeFit) -> Section:
    lit = np.arange(len(fit.readings.t_s)) < fit.n_charge
    after_s = fit.readings.t_s - fit.charge_s
    averaged = max(fit.n_charge, fit.n_decay) > MAX_POINTS
    caption = (
        f"{'Means of neighbouring readings' if averaged else 'Readings'} with ± 1 σ and the fit, "
        "dark level included. Below: their distance from the fit in σ; within the shade are 95 % "
        "if the model is right; readings further off than 10 σ are at the edge."
    )
    charge = _chart(fit, fit.readings.t_s, lit, is_logarithmic=False)
    decay = _chart(fit, after_s, ~lit, is_logarithmic=True)
    return Section(
        "Charge and decay",
        figures=(
            Picture("charge", charge, f"Charge. {caption}"),
            Picture("decay", decay, f"Decay. {caption}"),
        ),
    )


def _chart(
    fit: ChargeFit, t_s: FloatArray, own: NDArray[np.bool_], *, is_logarithmic: bool
) -> Chart:
    """Return the light of one part over its fit, and the residuals below."""
    readings = fit.readings
    t_s, light = t_s[own], readings.light[own]
    values, sigma = readings.values[own], readings.sigma[own]
    groups = _groups(t_s, is_logarithmic)
    weights = [sigma[rows] ** -2.0 for rows in groups]

    def mean(numbers: FloatArray) -> FloatArray:
        pairs = zip(groups, weights, strict=True)
        return np.array([np.average(numbers[rows], weights=each) for rows, each in pairs])

    at_s, value, curve = mean(t_s), mean(values), mean(light)
    mean_sigma = np.array([each.sum() ** -0.5 for each in weights])
    residual = np.clip((value - curve) / mean_sigma, -FARTHEST, FARTHEST)
    colour = OTHER_CHANNELS[0]
    if is_logarithmic:
        label = "Time after lamp off / s"
        time = logarithmic_axis(label, float(t_s[0]) * 0.8, float(t_s[-1]) * 1.2)
        top = float(value.max())
        positive = value[value > 0]
        low = max(float(positive.min()) * 0.7, top * 10.0**-MAX_DECADES)
        vertical = logarithmic_axis("Light", min(low, top / 10), top * 1.6)
    else:
        last = float(t_s[-1])
        time = linear_axis("Time after lamp on / s", -0.02 * last, 1.03 * last)
        top, bottom = float(value.max()), min(float(value.min()), 0.0)
        vertical = linear_axis("Light", bottom, top + 0.06 * (top - bottom))
    points: Mark = Points(colour, at_s, value, size_pt=3.4)
    upper = Panel(
        time,
        vertical,
        (ErrorBars(colour, at_s, value, mean_sigma), points, Line(INK, t_s, light, width_pt=0.9)),
        Margins(bottom=RESIDUALS_PT + 12),
        has_x_labels=False,
    )
    reach = max(1.1 * float(np.abs(residual).max()), 3.2)
    lower = Panel(
        time,
        linear_axis("Residual / σ", -reach, reach, most=4),
        (*_shade(time), Points(colour, at_s, residual, size_pt=3.0, is_clipped=False)),
        Margins(top=HEIGHT_PT - RESIDUALS_PT),
    )
    legend = (("measured", Points(colour, size_pt=5.0)), ("fit", Line(INK)))
    return Chart((upper, lower), HEIGHT_PT, legend=legend)


def _groups(t_s: FloatArray, is_logarithmic: bool) -> list[NDArray[np.intp]]:
    """Return the indices of the readings of each point."""
    if len(t_s) <= MAX_POINTS:
        return [np.array([row]) for row in range(len(t_s))]
    spaced = np.geomspace if is_logarithmic else np.linspace
    edges = spaced(t_s[0], t_s[-1], MAX_POINTS + 1)
    places = np.unique(np.searchsorted(t_s, [*edges[:-1], np.inf]))
    return [np.arange(begin, end) for begin, end in pairwise(places)]


def _shade(time: Axis) -> list[Mark]:
    """Return the line at zero, and the shade about it."""
    ends, ones = np.array([time.low, time.high]), np.ones(2)
    return [
        Band(SHADE, ends, -SHADED * ones, SHADED * ones, opacity=1.0),
        Line(MUTED, ends, 0 * ones, width_pt=0.8),
    ]
