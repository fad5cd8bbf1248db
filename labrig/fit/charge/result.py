"""Result of a fit to charge and decay, readable as text and as JSON; the file `fit.json`."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.number_format import aligned
from labrig.foundation.result_warning import ResultWarning, warning_lines
from labrig.results import Measured, OneSided, ProfileInterval, interval_lines, measured_number

UNKNOWN = "–"
#: Version of the JSON: another number means renamed keys or other meanings.
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class OrderState:
    """A state of general order; what charge and decay do not tell is None.

    Attributes
    ----------
    order
        Kinetic order b; its σ is 0 where it is held at 1, and it is one-sided at its bounds.
    amplitude
        Light at lamp off Λ k r(0)ᵇ, in the unit of the values.
    rate_at_off_per_s
        Rate p/τ in 1/s by which the light falls at lamp off, after *this* charge: k at b = 1.
    decay_time_s, exponent
        τ and p of (1 + t/τ)^(−p), the light after this charge, where b is above 1 by more than
        2 σ; where b is held at 1, an exponential, τ is 1/k and there is no p.
    kappa_per_s, k_r_per_s, r0, reradiation
        Excitation κ and re-radiation rate k in 1/s, concentration at lamp off, and Λ in the unit of
        the values times s; only where the charge saturates enough for κ to be known from both
        sides.
    """

    order: Measured
    amplitude: Measured
    rate_at_off_per_s: Measured
    decay_time_s: Measured | None
    exponent: Measured | None
    kappa_per_s: Measured | None
    k_r_per_s: Measured | None
    r0: Measured | None
    reradiation: Measured | None


@dataclass(frozen=True)
class ChargeCandidate:
    """A model that was tried.

    Attributes
    ----------
    states
        Number of its states.
    is_general
        Whether their orders are free; else they are 1.
    n_parameters
        Number of fitted parameters.
    chi2_charge, chi2_decay
        χ² of the readings under the lamp and after it, per reading.
    bic
        Bayesian information criterion, with the noise enlarged to the misfit of the best model.
    """

    states: int
    is_general: bool
    n_parameters: int
    chi2_charge: float
    chi2_decay: float
    bic: float

    @property
    def label(self) -> str:
        """The model in words."""
        number = f"{self.states} state{'s' if self.states > 1 else ''}"
        return f"{number} of {'general' if self.is_general else 'first'} order"


@dataclass(frozen=True, eq=False)
class FittedReadings:
    """Readings that were fitted, those under the lamp first.

    Attributes
    ----------
    t_s
        Middle of each reading in seconds after lamp on, shape (n,).
    values, sigma
        Values with the dark level, and their σ, shape (n,).
    light
        Light of the fit, shape (n,).
    """

    t_s: FloatArray
    values: FloatArray
    sigma: FloatArray
    light: FloatArray


@dataclass(frozen=True)
class ChargeFit(NotebookViews):
    """Charge and decay of one series, fitted with states of one kinetic order each.

    Attributes
    ----------
    states
        States by falling rate of their decay at lamp off.
    light_stimulated
        η, fraction of the carriers that find their trap filled and recombine at once; its σ is 0
        where it was given. As the prompt light it is one-sided at its bounds.
    prompt
        Light that is there only while the lamp is on, in the unit of the values.
    dark
        Light before the charge, in all readings.
    charge_s
        Length of the charge to which amplitudes and times belong.
    n_charge, n_decay
        Numbers of readings under the lamp and after it.
    chi2_charge, chi2_decay
        χ² of these readings, per reading.
    misfit
        Factor of the variance of all parameters by which sums of neighbouring residuals exceed
        noise; 1 where they do not.
    candidates
        Models that were tried; `chosen` is the one of this fit.
    chosen
        Index of the model among `candidates`.
    warnings
        Limits of the fit and remedies.
    readings
        What was fitted.
    intervals
        Intervals by profile likelihood, where ±σ misses them by more than 20 % or where they were
        asked for: by the name of a field of `OrderState` and the number of the state, such as
        `order 1`, and of `rate_at_off_per_s 1` and `lifetime_at_off_s 1`, the rate p/τ at which
        the light falls at lamp off, and its inverse.
    """

    states: tuple[OrderState, ...]
    light_stimulated: Measured
    prompt: Measured
    dark: Measured
    charge_s: float
    n_charge: int
    n_decay: int
    chi2_charge: float
    chi2_decay: float
    misfit: float
    candidates: tuple[ChargeCandidate, ...]
    chosen: int
    warnings: tuple[ResultWarning, ...]
    readings: FittedReadings = field(compare=False, repr=False)
    intervals: Mapping[str, ProfileInterval] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the tables and the warnings, a line each."""
        return "\n".join([self.table(), *warning_lines(self.warnings)])

    def table(self) -> str:
        """Return a table of the states and one of the models."""
        lines = [
            f"{self.candidates[self.chosen].label}, after {self.charge_s:g} s of charge",
            f"reduced χ²  charge {self.chi2_charge:.2f} ({self.n_charge} readings), "
            f"decay {self.chi2_decay:.2f} ({self.n_decay})",
        ]
        lines += aligned(self.state_rows())
        lines.append(
            f"light-stimulated η {_text(self.light_stimulated)}, prompt light "
            f"{_text(self.prompt)}, dark level {_text(self.dark)}"
        )
        if self.is_any_one_sided:
            lines.append("<, >: at a bound of the possible values, limit of 95 % probability")
        lines += interval_lines(self.named_intervals)
        lines += aligned(self.model_rows())
        return "\n".join(lines)

    @property
    def is_any_one_sided(self) -> bool:
        """True if a bound holds a parameter, which then has a limit instead of a σ."""
        common = (self.light_stimulated, self.prompt, self.dark)
        own = (getattr(state, each.name) for state in self.states for each in fields(state))
        return any(isinstance(each, OneSided) for each in (*common, *own))

    @property
    def named_intervals(self) -> dict[str, ProfileInterval]:
        """Intervals by the symbols and units of their parameters."""
        labels = AT_OFF_LABELS | COLUMN_LABELS
        named = {}
        for name, interval in self.intervals.items():
            quantity, _, number = name.partition(" ")
            symbol, *unit = labels[quantity].split(" / ")
            named[" / ".join((f"{symbol} {number}", *unit))] = interval
        return named

    def state_rows(self) -> list[list[str]]:
        """Return what is known of the states as a table, its head first."""
        columns = [each.name for each in fields(OrderState)]
        columns = [name for name in columns if any(getattr(s, name) for s in self.states)]
        rows = [["state", *(COLUMN_LABELS[name] for name in columns)]]
        for number, state in enumerate(self.states, start=1):
            rows.append([str(number), *(_text(getattr(state, name)) for name in columns)])
        return rows

    def model_rows(self) -> list[list[str]]:
        """Return the models that were compared as a table, its head first."""
        best = min(candidate.bic for candidate in self.candidates)
        rows = [["model", "χ² charge", "χ² decay", "ΔBIC"]]
        for number, candidate in enumerate(self.candidates):
            rows.append(
                [
                    candidate.label + (" *" if number == self.chosen else ""),
                    f"{candidate.chi2_charge:.2f}",
                    f"{candidate.chi2_decay:.2f}",
                    f"{candidate.bic - best:.0f}",
                ]
            )
        return rows

    def to_json(self) -> str:
        """Return the text of `fit.json`, numbers as `{"value": …, "sigma": …}`.

        A number that a bound holds has a `limit_95`, too.
        """
        content: dict[str, Any] = {
            "kind": "charge",
            "schema_version": SCHEMA_VERSION,
            "states": [_to_dict(state) for state in self.states],
            "light_stimulated": _number(self.light_stimulated),
            "prompt": _number(self.prompt),
            "dark": _number(self.dark),
            "charge_s": self.charge_s,
            "n_charge": self.n_charge,
            "n_decay": self.n_decay,
            "chi2_charge": self.chi2_charge,
            "chi2_decay": self.chi2_decay,
            "misfit": self.misfit,
            "intervals": {name: each.to_dict() for name, each in self.intervals.items()},
            "candidates": [vars(candidate) for candidate in self.candidates],
            "chosen": self.chosen,
            "warnings": [each.to_dict() for each in self.warnings],
        }
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


#: Rate at which the light falls at lamp off, and its inverse.
AT_OFF_LABELS = {"rate_at_off_per_s": "p/τ / s⁻¹", "lifetime_at_off_s": "τ/p / s"}
#: Heads of the columns of the table of states.
COLUMN_LABELS = {
    "order": "b",
    "amplitude": "amplitude",
    "rate_at_off_per_s": "p/τ / s⁻¹",
    "decay_time_s": "τ / s",
    "exponent": "p",
    "kappa_per_s": "κ / s⁻¹",
    "k_r_per_s": "k_r / s⁻¹",
    "r0": "r(0)",
    "reradiation": "Λ / (unit · s)",
}


def _text(measured: Measured | None) -> str:
    return UNKNOWN if measured is None else str(replace(measured, unit=""))


def _to_dict(state: OrderState) -> dict[str, Any]:
    return {each.name: _number(getattr(state, each.name)) for each in fields(state)}


def _number(measured: Measured | None) -> dict[str, float | None] | None:
    return None if measured is None else measured_number(measured)
