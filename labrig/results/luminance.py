"""Luminance of an afterglow at the times that trade standards name, and its marking."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from scipy.special import ndtr

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.number_format import aligned
from labrig.foundation.quantity import TIME_S, duration_text, parse
from labrig.foundation.result_warning import ResultWarning, warning_lines
from labrig.results.budget import Budget
from labrig.results.interval import NORMAL_95
from labrig.results.measured import Measured
from labrig.results.text_files import finite, json_text

#: Unit of luminances.
MCD_PER_M2 = "mcd/m²"
#: Times after lamp off of the table, and those of the marking, in seconds.
TABLE_S = (120.0, 600.0, 1800.0, 3600.0)
MARKING_S = (600.0, 3600.0)
#: Luminance to which the last time of a marking belongs, a hundred times the limit of visibility.
VISIBLE_MCD_PER_M2 = 0.3
#: Probability from which a requirement counts as met, and its complement as missed.
CONFIDENT = 0.95
#: Units of luminance by their names, in mcd/m².
LUMINANCE_UNITS = {
    "mcd/m2": 1.0, "cd/m2": 1000.0, "µcd/m2": 1e-3, "ucd/m2": 1e-3, "nit": 1000.0, "nits": 1000.0,
}  # fmt: skip
_REQUIREMENT = re.compile(r"\s*(?P<light>.*?)\s+at\s+(?P<time>.*?)\s*")


def luminance_unit(unit: str) -> float:
    """Return the mcd/m² in a unit of luminance.

    Parameters
    ----------
    unit
        Name of the unit, such as `cd/m2` or `mcd/m²`.

    Returns
    -------
    float
        Its value in mcd/m².

    Raises
    ------
    ValueError
        There is no such unit.

    Examples
    --------
    >>> from labrig.results import luminance_unit
    >>> luminance_unit("cd / m²")
    1000.0
    """
    name = re.sub(r"\s", "", unit).replace("²", "2").replace("^2", "2").replace("\u03bc", "µ")
    name = re.sub(r"cd[·*]?m(?:\^?[-−]2|⁻2)$", "cd/m2", name)
    if name not in LUMINANCE_UNITS:
        raise ValueError(f"expected one of {', '.join(LUMINANCE_UNITS)}, got '{unit}'")
    return LUMINANCE_UNITS[name]


def luminance_requirement(text: str) -> "LuminanceRequirement":
    """Return the requirement that a text states.

    Parameters
    ----------
    text
        Least luminance and time, such as `140 mcd/m2 at 10 min`.

    Returns
    -------
    LuminanceRequirement
        The requirement.

    Raises
    ------
    ValueError
        The text states none.

    Examples
    --------
    >>> from labrig.results import luminance_requirement
    >>> luminance_requirement("0.14 cd/m2 at 10 min")
    LuminanceRequirement(t_s=600.0, least_mcd_per_m2=140.0)
    """
    match = _REQUIREMENT.fullmatch(text)
    parts = match["light"].split(maxsplit=1) if match else []
    try:
        if match is None or len(parts) != 2:
            raise ValueError
        least = float(parts[0]) * luminance_unit(parts[1])
        t_s = parse(match["time"], TIME_S)
        if not (0 < least < math.inf and t_s > 0):
            raise ValueError
    except ValueError:
        raise ValueError(
            f"expected a least luminance and a time, such as '140 mcd/m2 at 10 min', got '{text}'"
        ) from None
    return LuminanceRequirement(t_s, least)


class Verdict(StrEnum):
    """Whether a requirement is met, within the errors of measurement."""

    PASS = "pass"
    FAIL = "fail"
    UNDECIDED = "not decided within the errors"
    NOT_MEASURED = "not measured"


@dataclass(frozen=True)
class LuminanceRequirement:
    """Least luminance at a time.

    Attributes
    ----------
    t_s
        Time after lamp off in seconds.
    least_mcd_per_m2
        Least luminance in mcd/m².
    """

    t_s: float
    least_mcd_per_m2: float


@dataclass(frozen=True)
class LuminanceAt:
    """Luminance at one time.

    Attributes
    ----------
    t_s
        Time after lamp off in seconds.
    luminance
        Luminance in mcd/m² with all errors; None where there are no readings around that time.
    """

    t_s: float
    luminance: Measured | None

    def verdict(self, least_mcd_per_m2: float) -> Verdict:
        """Return whether the luminance is at least as large, with a probability of 95 %."""
        if self.luminance is None:
            return Verdict.NOT_MEASURED
        above = self.luminance.value - least_mcd_per_m2
        sigma = self.luminance.sigma
        probability = float(ndtr(above / sigma)) if sigma > 0 else float(above >= 0)
        if probability >= CONFIDENT:
            return Verdict.PASS
        return Verdict.FAIL if probability <= 1 - CONFIDENT else Verdict.UNDECIDED


@dataclass(frozen=True)
class ForecastTime:
    """Time until a luminance after the last reading, as the readings before allow.

    Attributes
    ----------
    at_least
        Earliest time in s with its σ, by no law: ln L is convex for every sum of exponentials with
        amplitudes ≥ 0, and for retrapping. None where the last readings do not fall clearly.
    between_s
        Range in s that holds the time with a probability of 95 %; None if its end is ten times its
        begin or more: then the time is not determined.
    median_s
        Time in s that is as likely exceeded as not; None if it is not determined.
    laws
        Probabilities of the laws by their names, from predictions of the record's later part.
    """

    at_least: Measured | None
    between_s: tuple[float, float] | None
    median_s: float | None
    laws: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the range, or the earliest time, in words."""
        least = (
            "no time follows from the last readings"
            if self.at_least is None
            else f"at least {duration_text(self.least_s)} by its convexity"
        )
        if self.between_s is None:
            return f"{least}, the end not determined"
        early, late = (duration_text(end) for end in self.between_s)
        return f"{early} to {late} with 95 %" + ("" if self.at_least is None else f", {least}")

    @property
    def least_s(self) -> float:
        """Time in s that the earliest one exceeds with a probability of 97.5 %; 0 without it."""
        if self.at_least is None:
            return 0.0
        return max(self.at_least.value - NORMAL_95 * self.at_least.sigma, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class LuminanceDecay(NotebookViews):
    """Luminance of an afterglow, from its readings.

    Attributes
    ----------
    t_s, luminance_mcd_per_m2, luminance_mcd_per_m2_sigma
        Readings: time after lamp off in seconds, luminance and its σ, NaN where not given, (n,).
    scale_sigma
        Relative σ that is common to all readings, the largest of them if it changes, as at the
        dark end.
    at
        Luminance at the times of the table.
    required
        Requirements, and the luminance at their times.
    visible_s
        Time in seconds until which the luminance is above 0.3 mcd/m²; None if that was not
        measured.
    visible_forecast
        Forecast of that time where it is after the last reading; else None.
    slope
        −d ln L/d ln t from 10 to 60 min; None without luminances there.
    light_sum
        Integral of the luminance from the first to the last reading in mcd s/m².
    colours
        Letters of the colours for the marking; empty if not given.
    excitation
        Excitation as the user states it; empty if not given.
    origin
        Origin of the readings, a file or a run; empty if not given.
    warnings
        Limits of the results and remedies.
    """

    t_s: FloatArray
    luminance_mcd_per_m2: FloatArray
    luminance_mcd_per_m2_sigma: FloatArray
    scale_sigma: float
    at: tuple[LuminanceAt, ...]
    required: tuple[tuple[LuminanceRequirement, LuminanceAt], ...]
    visible_s: Measured | None
    visible_forecast: ForecastTime | None
    slope: Measured | None
    light_sum: Measured
    colours: str
    excitation: str
    origin: str
    warnings: tuple[ResultWarning, ...]

    @property
    def marking(self) -> str | None:
        """Marking such as `28/3.6-520-K-W`: at 10 min, at 60 min, until 0.3 mcd/m² in minutes.

        The time is missing where it was not measured; None without luminances at both times.
        """
        measured = {entry.t_s: entry.luminance for entry in self.at}
        early, late = (measured.get(t_s) for t_s in MARKING_S)
        if early is None or late is None:
            return None
        parts = [f"{early.value:.3g}/{late.value:.3g}"]
        parts += [f"{self.visible_s.value / 60:.0f}"] if self.visible_s else []
        parts += [self.colours] if self.colours else []
        return "-".join(parts)

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of luminances, of the light sum, and of the time until 0.3 mcd/m².

        The scale is the calibration; in σ of the time it is together with the noise.
        """
        has_scale, budgets = self.scale_sigma > 0, {}
        for entry in self.at:
            if (light := entry.luminance) is not None:
                budgets[f"luminance at {duration_text(entry.t_s)}"] = Budget.of(
                    light, self.scale_sigma * light.value if has_scale else None
                )
        # The sum of trapezia, as in σ of the light sum.
        common = self.scale_sigma * float(np.trapezoid(self.luminance_mcd_per_m2, self.t_s))
        budgets["light sum"] = Budget.of(self.light_sum, common if has_scale else None)
        if self.visible_s is not None:
            name = f"time until {VISIBLE_MCD_PER_M2:g} {MCD_PER_M2}"
            until = self.visible_s
            budgets[name] = Budget(until.value, until.unit, undivided=until.sigma)
        return budgets

    def __str__(self) -> str:
        """Return the table and the warnings, a line each."""
        return "\n".join([self.table(), *warning_lines(self.warnings)])

    def table(self) -> str:
        """Return a table for people."""
        marking = self.marking or "none: luminances at 10 and 60 min are missing"
        rows = [["marking", marking], ["luminance", "after lamp off"]]
        rows += [
            [f"  {duration_text(entry.t_s)}", _text(entry.luminance, "not measured")]
            for entry in self.at
        ]
        rows.append([f"until {VISIBLE_MCD_PER_M2:g} {MCD_PER_M2}", self._visible_text()])
        if self.slope is not None:
            rows.append(["slope, 10 to 60 min", f"L ∝ t⁻ⁿ, n = {self.slope}"])
        span = f"{duration_text(float(self.t_s[0]))} to {duration_text(float(self.t_s[-1]))}"
        rows.append(["light sum", f"{self.light_sum}, {span}"])
        rows.append(["excited by", self.excitation or "not stated: no standard's marking"])
        rows += [
            [
                f"at least {requirement.least_mcd_per_m2:g} at {duration_text(entry.t_s)}",
                f"{entry.verdict(requirement.least_mcd_per_m2)} "
                f"({_text(entry.luminance, 'no readings around it')})",
            ]
            for requirement, entry in self.required
        ]
        return "\n".join(aligned(rows))

    def _visible_text(self) -> str:
        if self.visible_s is not None:
            minutes = Measured(self.visible_s.value / 60, self.visible_s.sigma / 60, "min")
            return str(minutes)
        if self.visible_forecast is None:
            return "not measured"
        until = duration_text(float(self.t_s[-1]))
        return f"not reached until {until}; forecast: {self.visible_forecast}"

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `luminance.json`; what is not finite or not known is None."""
        content: dict[str, Any] = finite(
            {
                "schema_version": 1,
                "origin": self.origin,
                "budgets": {name: budget.to_dict() for name, budget in self.budgets().items()},
                "at": [
                    {"t_s": entry.t_s, "luminance_mcd_per_m2": _number(entry.luminance)}
                    for entry in self.at
                ],
                "visible_s": _number(self.visible_s),
                "visible_forecast": _forecast(self.visible_forecast),
                "slope": _number(self.slope),
                "light_sum_mcd_s_per_m2": _number(self.light_sum),
                "marking": self.marking,
                "excitation": self.excitation,
                "scale_sigma": self.scale_sigma,
                "requirements": [
                    {
                        "t_s": entry.t_s,
                        "least_mcd_per_m2": requirement.least_mcd_per_m2,
                        "luminance_mcd_per_m2": _number(entry.luminance),
                        "verdict": entry.verdict(requirement.least_mcd_per_m2).value,
                    }
                    for requirement, entry in self.required
                ],
                "warnings": [each.to_dict() for each in self.warnings],
            }
        )
        return content

    def to_json(self) -> str:
        """Return the text of `luminance.json`."""
        return json_text(self.to_dict())


def _text(measured: Measured | None, missing: str) -> str:
    return missing if measured is None else str(measured)


def _number(measured: Measured | None) -> dict[str, float] | None:
    return None if measured is None else {"value": measured.value, "sigma": measured.sigma}


def _forecast(forecast: ForecastTime | None) -> dict[str, Any] | None:
    if forecast is None:
        return None
    return {
        "at_least_s": _number(forecast.at_least),
        "between_s": forecast.between_s,
        "median_s": forecast.median_s,
        "laws": dict(forecast.laws),
    }
