"""The same sample on two days: do the numbers agree within what each is certain of?"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scipy import stats

from labrig.catalogue.results import Measured, PatchResult, read_results
from labrig.errors import DataError, UsageError
from labrig.yaml_file import did_you_mean, read_yaml

#: Chance alone makes two equal sets of numbers differ so much less often than this.
DIFFERENT_P = 0.01


@dataclass(frozen=True)
class Difference:
    """One quantity in both runs; `pull` is the difference B − A in σ of that difference."""

    quantity: str
    unit: str
    a: Measured
    b: Measured

    @property
    def pull(self) -> float:
        """NaN where nothing is known of the σ."""
        sigma = math.hypot(self.a.sigma, self.b.sigma)
        return (self.b.value - self.a.value) / sigma if 0 < sigma < math.inf else math.nan


@dataclass(frozen=True)
class PatchComparison:
    """One patch in both runs.

    Attributes
    ----------
    differences
        State by state; empty where the numbers of states differ.
    p_value
        Probability that equal rates come out as different as these; NaN if they cannot be told.
    """

    patch: str
    states: tuple[int, int]
    differences: tuple[Difference, ...]
    p_value: float

    @property
    def verdict(self) -> str:
        """In words."""
        if self.states[0] != self.states[1]:
            return f"{self.states[0]} and {self.states[1]} states: fit both with the same --states"
        if math.isnan(self.p_value):
            return "cannot be told: the uncertainties are not known"
        agree = "differ" if self.p_value < DIFFERENT_P else "agree"
        return f"the rates {agree} (p = {self.p_value:.2g})"


@dataclass(frozen=True)
class Comparison:
    """Two runs held against each other.

    Attributes
    ----------
    asked
        Keys of the protocol that differ, with both values.
    missing
        Patches that only one of the runs has.
    """

    asked: tuple[tuple[str, Any, Any], ...]
    patches: tuple[PatchComparison, ...]
    missing: tuple[str, ...]


def compare_runs(a: Path, b: Path, reference: str | None = None) -> Comparison:
    """The latest results of two runs.

    Parameters
    ----------
    reference
        Patch with a steady source that is there on both days. Its amplitude ties the days together:
        those of B are scaled by what the reference lost or gained.

    Raises
    ------
    DataError
        One of them has no result.
    UsageError
        There is no such reference in both.
    """
    of_a, of_b = _results(a), _results(b)
    shared = [name for name in of_a if name in of_b]
    if reference is not None and reference not in shared:
        raise UsageError(f"--reference {reference}: {did_you_mean(reference, shared)}")
    scale = Measured(1.0, 0.0)
    if reference is not None:
        scale = _ratio(_brightness(of_a[reference]), _brightness(of_b[reference]))
    return Comparison(
        asked=tuple(_differing(_protocol(a), _protocol(b))),
        patches=tuple(
            _compare(name or "sample", of_a[name], of_b[name], scale)
            for name in shared
            if name != reference
        ),
        missing=tuple(sorted(set(of_a) ^ set(of_b))),
    )


def _compare(name: str, a: PatchResult, b: PatchResult, scale: Measured) -> PatchComparison:
    counts = len(a.rates), len(b.rates)
    if counts[0] != counts[1]:
        return PatchComparison(name, counts, (), math.nan)
    rates = [
        Difference(f"k_r {number}", "1/s", of_a, of_b)
        for number, (of_a, of_b) in enumerate(zip(a.rates, b.rates, strict=True), start=1)
    ]
    amplitudes = [
        Difference(f"a {number}", "DN/s", of_a, _product(of_b, scale))
        for number, (of_a, of_b) in enumerate(zip(a.amplitudes, b.amplitudes, strict=True), start=1)
    ]
    chi2 = sum(difference.pull**2 for difference in rates)
    p_value = float(stats.chi2.sf(chi2, len(rates)))
    return PatchComparison(name, counts, (*rates, *amplitudes), p_value)


def _results(run: Path) -> dict[str, PatchResult]:
    results = {result.name: result for result in read_results(run)}
    if not results:
        raise DataError(f"{run}: it has no result to compare; make one: labrig process {run}")
    return results


def _protocol(run: Path) -> dict[str, Any]:
    return read_yaml(run / "protocol.yaml")


def _differing(
    a: Mapping[str, Any], b: Mapping[str, Any], place: str = ""
) -> list[tuple[str, Any, Any]]:
    found: list[tuple[str, Any, Any]] = []
    for key in dict.fromkeys([*a, *b]):
        of_a, of_b = a.get(key), b.get(key)
        if isinstance(of_a, dict) and isinstance(of_b, dict):
            found += _differing(of_a, of_b, f"{place}{key}.")
        elif of_a != of_b:
            found.append((f"{place}{key}", of_a, of_b))
    return found


def _brightness(result: PatchResult) -> Measured:
    """Of all states at lamp off; their σ are taken as independent."""
    return Measured(
        sum(amplitude.value for amplitude in result.amplitudes),
        math.hypot(*(amplitude.sigma for amplitude in result.amplitudes)),
    )


def _ratio(a: Measured, b: Measured) -> Measured:
    return _product(a, Measured(1 / b.value, b.sigma / b.value**2))


def _product(a: Measured, b: Measured) -> Measured:
    return Measured(a.value * b.value, math.hypot(a.sigma * b.value, a.value * b.sigma))
