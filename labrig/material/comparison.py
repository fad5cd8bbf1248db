"""Comparison of a measured material with a reference, such as Table 1 of Nalbach et al.

Two scales are free: k_e belongs to the light of one lamp, scaled to a stated length, and Λ is
relative. Each is multiplied by the factor that brings it closest to the reference.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.material.file import Material, State


@dataclass(frozen=True)
class Pair:
    """One quantity of both materials, NaN where a value or its σ is not known."""

    quantity: str
    unit: str
    measured: float
    sigma: float
    reference: float
    reference_sigma: float

    @property
    def percent(self) -> float:
        """Deviation of the measured value in per cent; NaN where the reference is 0."""
        return 100 * (self.measured / self.reference - 1) if self.reference else math.nan

    @property
    def in_sigma(self) -> float:
        """Deviation in units of σ of the difference, in which an unknown σ counts as 0."""
        sigma = math.hypot(_or_zero(self.sigma), _or_zero(self.reference_sigma))
        return (self.measured - self.reference) / sigma if sigma > 0 else math.nan


@dataclass(frozen=True)
class MaterialComparison(NotebookViews):
    """All quantities that at least one of two materials has.

    Attributes
    ----------
    names
        Names of the measured material and of the reference.
    pairs
        Measured and reference value of each quantity.
    k_e_factor, reradiation_factor
        Factors by which k_e and Λ of the measured material were multiplied.
    notes
        Quantities that could not be compared, and why.
    """

    names: tuple[str, str]
    pairs: tuple[Pair, ...]
    k_e_factor: float
    reradiation_factor: float
    notes: tuple[str, ...]


def compare_materials(measured: Material, reference: Material) -> MaterialComparison:
    """Compare two materials state by state, by falling rate, and band by band.

    Two scales are free: k_e belongs to the light of one lamp, and Λ is relative. Each is multiplied
    by the factor that brings `measured` closest to `reference`.

    Parameters
    ----------
    measured
        The material to judge.
    reference
        The material to compare with, such as the same in Table 1 of Nalbach et al.

    Returns
    -------
    MaterialComparison
        A pair of values for each quantity that one of the two materials has.

    Examples
    --------
    >>> import labrig
    >>> from labrig.material import compare_materials
    >>> measured = labrig.read_material("material.yaml")
    >>> comparison = compare_materials(measured, labrig.read_material("double-wide"))
    >>> for pair in comparison.pairs[::2]:
    ...     print(f"{pair.quantity}: {pair.measured:.3f} {pair.unit}, {pair.percent:+.1f} %")
    k_r 1: 0.205 s⁻¹, +2.4 %
    """
    notes = []
    measured_states, reference_states = _by_falling_rate(measured), _by_falling_rate(reference)
    if len(measured_states) != len(reference_states):
        notes.append(
            f"{measured.name} has {len(measured_states)} states, {reference.name} "
            f"{len(reference_states)}: their rows stand beside each other, but do not "
            "mean the same; fit as many (--states)."
        )
    if _orders(measured_states) != _orders(reference_states):
        notes.append(
            "Their kinetic orders differ, so their k_r and Λ do not mean the same: k_r is the rate "
            "of a full state only."
        )
    if not all(state.is_level_known for state in (*measured_states, *reference_states)):
        notes.append(
            "The charge of one of them was too far from saturation to separate k_r, r(0), k_e "
            "and Λ; they are left out."
        )
    has_order = not (measured.is_first_order and reference.is_first_order)
    if has_order:
        notes.append("τ belongs to each one's own charge: after more of it the glow fades sooner.")
    same_bands = measured.bands_nm == reference.bands_nm
    if not same_bands and measured.bands_nm is not None and reference.bands_nm is not None:
        notes.append("Their bands differ, so k_e and Λ are left out.")
    for symbol, name in (("k_e", "k_e_per_s"), ("Λ", "reradiation")):
        if all(getattr(state, name) is None for state in measured_states):
            notes.append(f"{symbol} was not measured.")
        if all(getattr(state, name) is None for state in reference_states):
            notes.append(f"The reference has no {symbol}.")
    k_e_factor = _closest(measured_states, reference_states, "k_e_per_s") if same_bands else 1.0
    reradiation_factor = (
        _closest(measured_states, reference_states, "reradiation") if same_bands else 1.0
    )
    pairs = []
    for number in range(max(len(measured_states), len(reference_states))):
        state = measured_states[number] if number < len(measured_states) else None
        reference_state = reference_states[number] if number < len(reference_states) else None
        label = f" {number + 1}" if max(len(measured_states), len(reference_states)) > 1 else ""
        pairs += _pairs(state, reference_state, label, "k_r", "s⁻¹", "k_r_per_s")
        if has_order:
            pairs += _pairs(state, reference_state, label, "b", "", "kinetic_order")
            pairs += _pairs(state, reference_state, label, "τ", "s", "decay_time_s")
        pairs += _pairs(state, reference_state, label, "r(0)", "", "r0")
        if same_bands and measured.bands_nm is not None:
            bands = measured.bands_nm
            pairs += _pairs(
                state, reference_state, label, "k_e", "s⁻¹", "k_e_per_s", bands, k_e_factor
            )
            pairs += _pairs(
                state, reference_state, label, "Λ", "", "reradiation", bands, reradiation_factor
            )
    return MaterialComparison(
        (measured.name, reference.name), tuple(pairs), k_e_factor, reradiation_factor, tuple(notes)
    )


def _by_falling_rate(material: Material) -> Sequence[State]:
    return sorted(material.states, key=lambda state: -state.k_r_per_s)


def _orders(states: Sequence[State]) -> list[float]:
    return [state.kinetic_order for state in states]


def _closest(
    measured_states: Sequence[State], reference_states: Sequence[State], name: str
) -> float:
    """Return the c that minimises Σ (c x − x')² over states and bands of `name`; 1 without any."""
    values = [
        (np.array(state.known(name)), np.array(reference_state.known(name)))
        for state, reference_state in zip(measured_states, reference_states, strict=False)
        if state.known(name) is not None and reference_state.known(name) is not None
    ]
    square = sum(float(value @ value) for value, _ in values)
    product = sum(float(value @ reference) for value, reference in values)
    return product / square if square > 0 and product > 0 else 1.0


def _pairs(
    state: State | None,
    reference_state: State | None,
    label: str,
    symbol: str,
    unit: str,
    name: str,
    bands: Sequence[float] = (),
    factor: float = 1.0,
) -> list[Pair]:
    """Return `name` of two states as one pair or one per band; none if both lack it."""
    value, sigma = _values(state, name)
    reference, reference_sigma = _values(reference_state, name)
    if value is None and reference is None:
        return []
    count = len(value if value is not None else reference if reference is not None else ())
    missing = np.full(count, math.nan)
    places = [f" {low:g}–{high:g} nm" for low, high in pairwise(bands)] or [""]
    columns = [
        missing if column is None else column * scale
        for column, scale in (
            (value, factor),
            (sigma, factor),
            (reference, 1),
            (reference_sigma, 1),
        )
    ]
    return [
        Pair(f"{symbol}{label}{place}", unit, *map(float, numbers))
        for place, *numbers in zip(places, *columns, strict=True)
    ]


def _values(state: State | None, name: str) -> tuple[FloatArray | None, FloatArray | None]:
    """Return value and σ of a quantity of `state`, shape (1,) or (bands,), None where not known."""
    known = None if state is None else state.known(name)
    if name == "decay_time_s" and known is None and state is not None:
        known = state.decay_time_of_rate_s
    sigma_known = None if known is None else getattr(state, f"{name}_sigma")
    value, sigma = (
        None if column is None else np.atleast_1d(np.array(column, float))
        for column in (known, sigma_known)
    )
    return value, sigma


def _or_zero(sigma: float) -> float:
    return 0.0 if math.isnan(sigma) else sigma
