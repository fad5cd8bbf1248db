"""Depth of a trap, by decay rates at several temperatures."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.number_format import aligned, rounded
from labrig.foundation.quantity import BOLTZMANN_EV_PER_K, ZERO_C_K
from labrig.foundation.result_warning import ResultWarning, warning_lines
from labrig.results.budget import Budget
from labrig.results.measured import Measured
from labrig.results.text_files import finite, json_text


@dataclass(frozen=True, eq=False, kw_only=True)
class TrapDepth(NotebookViews):
    """Arrhenius' law k = s exp(−E / k_B T) of a state of first order, with its measured rates.

    Attributes
    ----------
    temperature_c, rate_per_s, rate_per_s_sigma
        Temperatures in °C, rising, and rates with σ in 1/s, shape (n,).
    temperature_sigma_k
        σ of each temperature in K.
    depth_ev
        Depth E of the trap in eV.
    log10_frequency
        Decadic logarithm of the frequency factor s in 1/s.
    log_rate, reference_c
        Natural logarithm of the rate in 1/s at the reference temperature, in °C, at which it does
        not depend on the depth's error.
    chi2, dof, p_value
        Misfit, degrees of freedom, and the chance of a larger misfit; NaN of two temperatures.
    warnings
        Limits of the depth and remedies.
    """

    temperature_c: FloatArray
    rate_per_s: FloatArray
    rate_per_s_sigma: FloatArray
    temperature_sigma_k: float
    depth_ev: Measured
    log10_frequency: Measured
    log_rate: Measured
    reference_c: float
    chi2: float
    dof: int
    p_value: float
    warnings: tuple[ResultWarning, ...]

    def rate_at(self, temperature_c: float) -> Measured:
        """Return the rate at a temperature in °C, with σ."""
        kelvin = np.array([self.reference_c, temperature_c]) + ZERO_C_K
        inverse_ev = float(1 / kelvin[0] - 1 / kelvin[1]) / BOLTZMANN_EV_PER_K
        rate = math.exp(self.log_rate.value + self.depth_ev.value * inverse_ev)
        return Measured(
            rate, rate * math.hypot(self.log_rate.sigma, inverse_ev * self.depth_ev.sigma), "1/s"
        )

    def budget(self) -> Budget:
        """Return the budget of the depth: σ of rates and of temperatures come together."""
        return Budget(self.depth_ev.value, "eV", undivided=self.depth_ev.sigma)

    def __str__(self) -> str:
        """Return the table and the warnings, a line each."""
        return "\n".join([self.table(), *warning_lines(self.warnings)])

    def table(self) -> str:
        """Return a table for people."""
        low, high = self.temperature_c[[0, -1]]
        misfit = (
            "none: two temperatures"
            if self.dof == 0
            else (
                f"χ² {rounded(self.chi2, 2)} of {self.dof} degrees of freedom, "
                f"p = {self.p_value:.2g}"
            )
        )
        rows = [
            ["depth E", str(self.depth_ev)],
            ["frequency factor s", f"10^{self.log10_frequency} 1/s"],
            [f"k_r at {self.reference_c:.1f} °C", str(self.rate_at(self.reference_c))],
            ["temperatures", f"{len(self.temperature_c)}, {low:.1f} °C to {high:.1f} °C"],
            ["misfit", misfit],
        ]
        return "\n".join(aligned(rows))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the state in `trap_depth.json`."""
        content: dict[str, Any] = finite(
            {
                "temperature_c": self.temperature_c.tolist(),
                "k_r_per_s": self.rate_per_s.tolist(),
                "k_r_per_s_sigma": self.rate_per_s_sigma.tolist(),
                "temperature_sigma_k": self.temperature_sigma_k,
                "depth_ev": _number(self.depth_ev),
                "budgets": {"depth": self.budget().to_dict()},
                "log10_frequency_per_s": _number(self.log10_frequency),
                "k_r_at_reference_per_s": _number(self.rate_at(self.reference_c)),
                "reference_c": self.reference_c,
                "chi2": self.chi2,
                "dof": self.dof,
                "p_value": self.p_value,
                "warnings": [each.to_dict() for each in self.warnings],
            }
        )
        return content


@dataclass(frozen=True)
class StateDepth:
    """Depth of one state of one patch.

    Attributes
    ----------
    patch
        Name of the patch; empty of the only one.
    number
        Number of the state by falling rate, from 1.
    depth
        The depth.
    """

    patch: str
    number: int
    depth: TrapDepth

    @property
    def name(self) -> str:
        """Name of the state, with its patch where there are several."""
        return state_name(self.patch, self.number)


def state_name(patch: str, number: int) -> str:
    """Return the name of a state: `state 1`, or `left, state 1` of a patch.

    Parameters
    ----------
    patch
        Name of the patch; empty of the only one.
    number
        Number of the state from 1.

    Returns
    -------
    str
        The name.

    Examples
    --------
    >>> from labrig.results import state_name
    >>> state_name("", 1), state_name("left", 2)
    ('state 1', 'left, state 2')
    """
    return f"{patch}, state {number}" if patch else f"state {number}"


def trap_depths_json(depths: tuple[StateDepth, ...], runs: tuple[str, ...]) -> str:
    """Return the text of `trap_depth.json`.

    Parameters
    ----------
    depths
        Depths of all states.
    runs
        Names of the runs.

    Returns
    -------
    str
        The states with their rates, and the names.

    Examples
    --------
    >>> from labrig.results import trap_depths_json
    >>> print(trap_depths_json((), ("monday", "tuesday")).split()[1])
    "schema_version":
    """
    states = [
        {"patch": each.patch, "state": each.number, **each.depth.to_dict()} for each in depths
    ]
    return json_text({"schema_version": 1, "runs": list(runs), "states": states})


def _number(measured: Measured) -> dict[str, float]:
    return {"value": measured.value, "sigma": measured.sigma}
