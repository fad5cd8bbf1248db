"""Comparison of two runs of the same sample within their uncertainties."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtrc

from labrig.catalogue.comparable import not_comparable
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError, DiskError, UsageError
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.foundation.yaml_file import did_you_mean
from labrig.record import (
    FrameRole,
    glow_temperature_c,
    plan_content,
    read_run,
    relative_rate_change,
)
from labrig.results import (
    EXPONENTIALS,
    LAW_LABELS,
    LAW_SYMBOLS,
    FittedDecay,
    FittedLaw,
    Measured,
    read_fitted_decays,
    read_series,
)


def gain(a: Path, b: Path, name: str, channel: str) -> Measured:
    """Return the signal of the patch `name` in run A over that in run B, in one channel.

    The signal of a reference that decays is the sum of its amplitudes; that of a steady one,
    without a fitted decay, is the mean of its frames.

    Raises
    ------
    UsageError
        If the patch is not in both runs, or decays in one of them only.
    DataError
        If the patch is dark, or its series is damaged.
    """
    shared = [patch for patch in _patches(a) if patch in _patches(b)]
    if name not in shared:
        hint = did_you_mean(name, shared) if shared else "they share none"
        raise UsageError(
            f"--reference {name}: expected a patch of its own, in both runs, with a source that "
            f"is the same on both days; {hint}"
        )
    fits = [read_fitted_decays(run / "result").get(name) for run in (a, b)]
    if (fits[0] is None) != (fits[1] is None):
        raise UsageError(
            f"--reference {name}: it decays in one run and is steady in the other; expected a "
            "source that is the same on both days"
        )
    signal_a, signal_b = (
        _steady(run, name, channel) if fit is None else _glow(fit, channel)
        for run, fit in zip((a, b), fits, strict=True)
    )
    for run, signal in ((a, signal_a), (b, signal_b)):
        if not signal.value > DETECTION_SIGMA * signal.sigma:
            raise DataError(
                f"--reference {name}: expected light in {channel} that stands out by "
                f"{DETECTION_SIGMA:g} σ, got {signal.value:.3g} ± {signal.sigma:.2g} DN/s in {run}"
            )
    return signal_a.over(signal_b)


def _patches(run: Path) -> list[str]:
    """Return the names of the patches with result folders of their own, fitted or not."""
    return sorted(path.parent.name for path in (run / "result").glob("*/series.csv"))


def _glow(fit: FittedDecay, channel: str) -> Measured:
    """Return the sum of all amplitudes in DN/s, their σ taken as independent."""
    amplitudes = fit.amplitudes_in(channel)
    return Measured(
        sum(amplitude.value for amplitude in amplitudes),
        math.hypot(*(amplitude.sigma for amplitude in amplitudes)),
    )


def _steady(run: Path, name: str, channel: str) -> Measured:
    """Return the mean of a channel in DN/s, with σ by its scatter from frame to frame."""
    path = run / "result" / name / "series.csv"
    parts = [part for part in read_series(path) if channel in part.channels]
    columns = [part.values[part.usable, part.channels.index(channel)] for part in parts]
    values = np.concatenate([*columns, []])
    if len(values) < 2:
        raise DataError(f"{path}: expected usable frames with a channel {channel}, got too few")
    scatter = values.std(ddof=1) / math.sqrt(len(values))
    return Measured(float(values.mean()), float(scatter))


#: Significance level below which rates differ.
DIFFERENT_P = 0.01
#: Difference of temperatures from which a comparison says so, in K: rates change by 18 %.
SAME_TEMPERATURE_K = 2.0
NO_GAIN = Measured(1.0, 0.0)
#: Smallest p-value that is reported as a number.
MIN_P = 1e-9


@dataclass(frozen=True)
class Difference:
    """One quantity in two runs.

    Attributes
    ----------
    quantity
        Name of the quantity.
    unit
        Unit of the quantity.
    a, b
        Values with σ in runs A and B.
    """

    quantity: str
    unit: str
    a: Measured
    b: Measured

    @property
    def pull(self) -> float:
        """Difference B − A in units of its σ; NaN if σ is not known."""
        return self.b.sigmas_from(self.a)


@dataclass(frozen=True)
class PatchComparison:
    """One patch in two runs.

    Attributes
    ----------
    patch
        Name of the patch.
    laws
        Laws of decay that were chosen in runs A and B.
    states
        Numbers of states in runs A and B, of exponentials.
    differences
        Differences of the parameters, of exponentials state by state; empty if laws or numbers of
        states differ.
    p_value
        Probability that equal rates, or laws, differ at least as much as these; NaN if it is not
        known.
    gain
        Factor by which the amplitudes of run B were multiplied; 1 without a reference.
    """

    patch: str
    laws: tuple[str, str]
    states: tuple[int, int]
    differences: tuple[Difference, ...]
    p_value: float
    gain: Measured

    @property
    def assessment(self) -> str:
        """Assessment of the differences as text."""
        if self.laws[0] != self.laws[1]:
            labels = " and ".join(LAW_LABELS[law] for law in self.laws)
            return f"{labels}: process both with the same --law"
        is_sum = self.laws[0] == EXPONENTIALS
        if is_sum and self.states[0] != self.states[1]:
            return f"{self.states[0]} and {self.states[1]} states: fit both with the same --states"
        if math.isnan(self.p_value):
            return "not decided: the uncertainties are not known"
        agree = "differ" if self.p_value < DIFFERENT_P else "agree"
        p = f"p = {self.p_value:.2g}" if self.p_value >= MIN_P else f"p < {MIN_P:g}"
        if is_sum:
            return f"the rates {agree} ({p})"
        return f"the decays by {LAW_LABELS[self.laws[0]]} {agree} ({p})"


@dataclass(frozen=True)
class Comparison(NotebookViews):
    """Comparison of two runs.

    Attributes
    ----------
    protocol_differences
        Keys of the protocol that differ, each with both values.
    patches
        Comparisons of the patches fitted in both runs.
    missing
        Patches fitted in only one of the runs.
    temperatures_c
        Temperatures of the glow in runs A and B in °C; None where not known.
    """

    protocol_differences: tuple[tuple[str, Any, Any], ...]
    patches: tuple[PatchComparison, ...]
    missing: tuple[str, ...]
    temperatures_c: tuple[float | None, float | None]

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the differences of all patches as `differences.csv`."""
        head = ("patch", "quantity", "unit", "a", "a_sigma", "b", "b_sigma", "difference (σ)")
        rows = [
            (
                patch.patch, each.quantity, each.unit,
                each.a.value, each.a.sigma, each.b.value, each.b.sigma, each.pull,
            )
            for patch in self.patches
            for each in patch.differences
        ]  # fmt: skip
        return {"differences.csv": CsvTable(head, rows)}

    @property
    def warnings(self) -> tuple[ResultWarning, ...]:
        """Limits of the comparison."""
        a, b = self.temperatures_c
        if a is None or b is None or abs(b - a) <= SAME_TEMPERATURE_K:
            return ()
        return (
            Disturbance(
                "temperatures-differ",
                "run B was measured at {b_c:.1f} °C, run A at {a_c:.1f} °C: k_r changes by about "
                "{rate_change_percent:+.0f} % over that, if traps are 0.65 eV deep",
                a_c=a,
                b_c=b,
                rate_change_percent=100 * relative_rate_change(a, b),
            ),
        )


def compare_runs(a: Path, b: Path, reference: str | None = None) -> Comparison:
    """Compare the latest results of two runs of the same sample.

    Parameters
    ----------
    a
        Folder of the first run.
    b
        Folder of the second run.
    reference
        Patch with a source that is the same in both runs, steady or decaying. The amplitudes of run
        B are scaled by the ratio of its signals.

    Returns
    -------
    Comparison
        Differences of rates and amplitudes by patch in units of their σ, and of the protocols.

    Raises
    ------
    DataError
        If one of the runs has no result yet.
    UsageError
        If one of them is of a kind that fits no decay, or the reference is not a patch of both.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import compare_runs
    >>> comparison = compare_runs(Path("runs/decay"), Path("runs/decay"))
    >>> comparison.patches[0].assessment
    'the rates agree (p = 1)'
    >>> [difference.quantity for difference in comparison.patches[0].differences]
    ['k_r 1', 'k_r 2', 'a 1', 'a 2']
    """
    protocols = plan_content(a, "protocol.yaml"), plan_content(b, "protocol.yaml")
    results_a, results_b = (
        _results(run, protocol) for run, protocol in zip((a, b), protocols, strict=True)
    )
    if (error := not_comparable(a, b, (bool(results_a), bool(results_b)))) is not None:
        raise error
    if len(results_a) == len(results_b) == 1:  # the one patch, whatever it is called
        results_b = dict(zip(results_a, results_b.values(), strict=True))
    shared = [name for name in results_a if name in results_b and name != reference]
    gains = {
        name: NO_GAIN
        if reference is None
        else gain(a, b, reference, results_a[name].brightest_channel)
        for name in shared
    }
    return Comparison(
        protocol_differences=tuple(
            (key, *values)
            for key, *values in _differing(*protocols)
            # listed in `missing`
            if not (key.startswith("patches.") and None in values)
        ),
        patches=tuple(
            _compare(name, results_a[name], results_b[name], gains[name]) for name in shared
        ),
        missing=tuple(sorted(set(results_a) ^ set(results_b))),
        temperatures_c=(_temperature_c(a), _temperature_c(b)),
    )


def _temperature_c(run: Path) -> float | None:
    try:
        return glow_temperature_c(read_run(run), [FrameRole.DECAY])
    except (DataError, DiskError):  # a result that was copied without its journal
        return None


def _compare(name: str, a: FittedDecay, b: FittedDecay, gain_b: Measured) -> PatchComparison:
    laws, counts = (a.law, b.law), (len(a.rates), len(b.rates))
    if a.law != b.law:
        return PatchComparison(name, laws, counts, (), math.nan, gain_b)
    law_a, law_b = a.chosen_law, b.chosen_law
    if law_a is not None and law_b is not None:
        both = a.reference.is_lamp_off and b.reference.is_lamp_off
        differences, p_value = _differences_of_laws(law_a, law_b, a.brightest_channel, gain_b)
        # Amplitudes at different times are not to be compared.
        differences = differences if both else differences[:-1]
        return PatchComparison(name, laws, counts, differences, p_value, gain_b)
    if counts[0] != counts[1]:
        return PatchComparison(name, laws, counts, (), math.nan, gain_b)
    rates = [
        Difference(f"k_r {number}", "1/s", value_a, value_b)
        for number, (value_a, value_b) in enumerate(zip(a.rates, b.rates, strict=True), start=1)
    ]
    channel = a.brightest_channel
    pairs = zip(a.amplitudes_in(channel), b.amplitudes_in(channel), strict=True)
    amplitudes = [
        Difference(f"a {number}", f"DN/s of channel {channel}", value_a, value_b.times(gain_b))
        for number, (value_a, value_b) in enumerate(pairs, start=1)
    ]
    chi2 = sum(difference.pull**2 for difference in rates)
    p_value = float(chdtrc(len(rates), chi2))
    return PatchComparison(name, laws, counts, (*rates, *amplitudes), p_value, gain_b)


def _differences_of_laws(
    a: FittedLaw, b: FittedLaw, channel: str, gain_b: Measured
) -> tuple[tuple[Difference, ...], float]:
    """Return the differences of a law's parameters, and the probability of such in rate and shape.

    Rate and shape determine the course of the decay, and depend on each other.
    """
    shared = [name for name in a.parameters if name in b.parameters]
    own = [
        Difference(*LAW_SYMBOLS[name], a.parameters[name], b.parameters[name]) for name in shared
    ]
    amplitude_a, amplitude_b = (
        Measured(law.amplitude, math.sqrt(law.covariance[0, 0])) for law in (a, b)
    )
    amplitude = Difference(
        "a", f"DN/s of channel {channel}", amplitude_a, amplitude_b.times(gain_b)
    )
    apart = np.array([b.rate_per_s - a.rate_per_s, b.shape - a.shape])
    covariance = (a.covariance + b.covariance)[1:3, 1:3]
    if not np.isfinite(covariance).all():
        return (*own, amplitude), math.nan
    chi2 = float(apart @ np.linalg.pinv(covariance) @ apart)
    return (*own, amplitude), float(chdtrc(len(apart), chi2))


def _results(run: Path, protocol: Mapping[str, Any]) -> dict[str, FittedDecay]:
    """Return the fits of a run by patch, also where it has one patch only."""
    only = next(iter(protocol.get("patches") or ["sample"]))
    read = read_fitted_decays(run / "result")
    return {name or only: result for name, result in read.items()}


def _differing(
    a: Mapping[str, Any], b: Mapping[str, Any], place: str = ""
) -> list[tuple[str, Any, Any]]:
    differences: list[tuple[str, Any, Any]] = []
    # Of protocols of two kinds, only keys that both have are to be compared.
    is_alike = a.get("protocol") == b.get("protocol")
    for key in dict.fromkeys([*a, *b]) if is_alike else [key for key in a if key in b]:
        value_a, value_b = a.get(key), b.get(key)
        if isinstance(value_a, dict) and isinstance(value_b, dict):
            differences += _differing(value_a, value_b, f"{place}{key}.")
        elif value_a != value_b:
            differences.append((f"{place}{key}", value_a, value_b))
    return differences
