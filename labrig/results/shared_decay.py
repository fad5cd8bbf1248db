"""Fit of several tables with shared rates, readable as text and as JSON."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.number_format import aligned
from labrig.foundation.result_warning import ResultWarning, warning_lines
from labrig.material import exponential_means
from labrig.results.decay_reference import DecayReference
from labrig.results.fitted_decay import Candidate, DecayState
from labrig.results.measured import Measured, OneSided, measured_number, with_uncertainty
from labrig.results.text_files import finite, json_text

#: Amplitude in σ that is as good as 0, at which its bound holds it.
AT_BOUND = 1e-6


@dataclass(frozen=True)
class TableDecay:
    """Decay of one of the tables that share rates.

    Attributes
    ----------
    name
        Name of the table.
    states
        Exponentials by falling rate; the rates are those of all tables, the amplitudes its own.
    offset, offset_sigma
        Constant background in the unit of its values; σ is 0 if it was held at zero.
    reference
        Time at which its amplitudes hold.
    n_values, chi2, dof
        Number of its values, their χ², and their degrees of freedom by the fit's leverage.
    residual_sigma
        Standard deviation of its residuals; None if its values had σ of their own.
    """

    name: str
    states: tuple[DecayState, ...]
    offset: float
    offset_sigma: float
    reference: DecayReference
    n_values: int
    chi2: float
    dof: float
    residual_sigma: float | None

    @property
    def amplitudes(self) -> tuple[Measured, ...]:
        """Amplitudes by falling rate; one-sided where the table has none of a state's light."""
        return tuple(
            OneSided.held(0.0, state.amplitude_sigma, 0.0)
            if state.amplitude <= AT_BOUND * state.amplitude_sigma
            else Measured(state.amplitude, state.amplitude_sigma)
            for state in self.states
        )

    def predict(self, t_s: FloatArray, exposure_s: FloatArray) -> FloatArray:
        """Return the signal of exposures that begin at some times as fitted, offset included."""
        rates = np.array([state.k_r_per_s for state in self.states])
        amplitudes = np.array([state.amplitude for state in self.states])
        means = exponential_means(rates, t_s - self.reference.t_s, exposure_s)
        return np.asarray(means @ amplitudes + self.offset)


@dataclass(frozen=True, eq=False)
class SharedDecay(NotebookViews):
    """Decays of several tables with the same rates.

    Attributes
    ----------
    tables
        Decay of each table.
    chi2, dof, bic
        χ² of all tables, its degrees of freedom, and the Bayesian information criterion.
    covariance_parameters, covariance
        Names of all parameters, and their covariance, shape (p, p).
    candidates
        Fits with each number of states that was tried.
    warnings
        Limits of the fit and remedies.
    """

    tables: tuple[TableDecay, ...]
    chi2: float
    dof: int
    bic: float
    covariance_parameters: tuple[str, ...]
    covariance: FloatArray
    candidates: tuple[Candidate, ...]
    warnings: tuple[ResultWarning, ...]

    @property
    def rates(self) -> tuple[Measured, ...]:
        """Rates of all tables in 1/s, falling."""
        return tuple(
            Measured(state.k_r_per_s, state.k_r_per_s_sigma, "1/s")
            for state in self.tables[0].states
        )

    def to_json(self) -> str:
        """Return the text of `fit.json`; values that are not finite are null."""
        fields: dict[str, Any] = {
            "kind": "shared-decay",
            "schema_version": 1,
            "n_states": len(self.rates),
            "rates": [
                {"k_r_per_s": rate.value, "k_r_per_s_sigma": rate.sigma} for rate in self.rates
            ],
            "tables": [
                asdict(table) | {"amplitudes": [measured_number(a) for a in table.amplitudes]}
                for table in self.tables
            ],
            "chi2": self.chi2,
            "dof": self.dof,
            "reduced_chi2": self.chi2 / self.dof,
            "bic": self.bic,
            "covariance_parameters": list(self.covariance_parameters),
            "covariance": self.covariance.tolist(),
            "candidates": [asdict(candidate) for candidate in self.candidates],
            "warnings": [each.to_dict() for each in self.warnings],
        }
        return json_text(finite(fields))

    def table_rows(self) -> list[list[str]]:
        """Return rows of amplitudes and offsets, a table each, with their heads first."""
        heads = [f"amplitude {number}" for number in range(1, len(self.rates) + 1)]
        rows = [["table", *heads, "offset", "χ²/dof", "amplitudes at"]]
        for table in self.tables:
            rows.append(
                [
                    table.name,
                    *map(str, table.amplitudes),
                    with_uncertainty(table.offset, table.offset_sigma)
                    if table.offset_sigma
                    else "0",
                    f"{table.chi2 / table.dof:.3g}" if table.dof > 0 else "–",
                    str(table.reference),
                ]
            )
        return rows

    def rate_rows(self) -> list[list[str]]:
        """Return rows of the rates, with their heads first."""
        return [
            ["state", "k / s⁻¹", "1/k / s"],
            *(
                [
                    str(number),
                    with_uncertainty(rate.value, rate.sigma),
                    with_uncertainty(1 / rate.value, rate.sigma / rate.value**2),
                ]
                for number, rate in enumerate(self.rates, start=1)
            ),
        ]

    def __str__(self) -> str:
        """Return the tables and the warnings, a line each."""
        return "\n".join([self.table(), *warning_lines(self.warnings)])

    def table(self) -> str:
        """Return tables for people; digits in brackets are σ in units of the last places."""
        lines = [*aligned(self.rate_rows()), *aligned(self.table_rows())]
        lines.append(f"reduced χ² {self.chi2 / self.dof:.3g} ({self.dof} dof), BIC {self.bic:.1f}")
        return "\n".join(lines)
