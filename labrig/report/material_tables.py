"""Tables of a material as measured, and of its comparison with another."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from labrig.foundation.number_format import aligned, plus_minus, rounded
from labrig.material import Albedo, Material, MaterialComparison, RadianceFactor, State
from labrig.report.sections import Table
from labrig.results import ONE_SIDED_SIGMAS, OneSided

UNKNOWN = "–"
#: Units of amplitude and Λ by the scale of a material.
UNITS = {
    None: ("", ""),
    "relative": (" / sr⁻¹", " / s sr⁻¹"),
    "absolute": (" / W m⁻² sr⁻¹ nm⁻¹", " / W s m⁻² sr⁻¹ nm⁻¹"),
}
#: What the caption says of a scale.
SCALES = {
    "relative": " Λ is relative to the lamp's mean spectral irradiance over the bands.",
    "absolute": " Λ is absolute, by a reading in lux.",
}
#: Wavelengths in nm at which the albedo is told.
ALBEDO_NM = (450.0, 500.0, 550.0, 600.0, 650.0)


def measured_table(material: Material) -> Table:
    """Return the table of all values of a material with their σ, in one column a state."""
    states = sorted(material.states, key=lambda state: -state.k_r_per_s)
    head = ("",) if len(states) == 1 else ("", *(f"State {n + 1}" for n in range(len(states))))
    rows = tuple(_rows(states, material.bands_nm or (), material.scale))
    caption = "Value ± standard uncertainty (1 σ)."
    if material.irradiance_norm is not None:
        length = material.irradiance_norm.value
        caption += (
            " k_e is per unit of the lamp's irradiance, whose values in the bands are scaled so "
            f"that the root of the sum of their squares is {length:g}"
            + ("; Λ is relative radiance." if material.scale is None else ".")
        )
    elif any(state.k_e_per_s for state in states):
        caption += " k_e is per W m⁻² of irradiance in the band."
    caption += SCALES.get(material.scale or "", "")
    if any(state.decay_time_of_rate_s is not None for state in states):
        caption += (
            " The glow of a kinetic order b decays as a (1 + t/τ)^(−p), after the charge to which "
            "r(0) belongs; k_r is the rate of a full state."
        )
    if not all(state.is_level_known for state in states):
        caption += (
            " The charge was too far from saturation to separate k_r, r(0), k_e and Λ: they are "
            "left out, though the file has values for predictions, good for charges like this one."
        )
    return Table(head if len(states) > 1 else ("", "measured"), rows, caption)


def describe_phosphor(material: Material) -> str:
    """Describe a phosphor in lines of text.

    Parameters
    ----------
    material
        A phosphor.

    Returns
    -------
    str
        Its name and origin, then a line for each quantity, with a column for each state.

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import describe_phosphor
    >>> for line in describe_phosphor(labrig.read_material("double-wide")).splitlines()[:4]:
    ...     print(line)
    double-wide: phosphor of 2 states
      source: made for labrig
                              State 1  State 2
      k_r / s⁻¹               0.2      0.01
    """
    table = measured_table(material)
    states = f"{len(material.states)} state" + ("s" if len(material.states) > 1 else "")
    lines = [f"{material.name}: phosphor of {states}"]
    if material.provenance is not None:
        lines.append(f"  source: {material.provenance.source}")
    rows = [table.head, *table.rows] if len(material.states) > 1 else list(table.rows)
    lines += [f"  {line}" for line in aligned(rows)]
    return "\n".join([*lines, *surface_lines(material), table.caption])


def surface_lines(material: Material) -> tuple[str, ...]:
    """Describe scale, albedo, total radiance factor and layer, as far as they are known.

    Parameters
    ----------
    material
        A phosphor.

    Returns
    -------
    tuple of str
        A line for each; none of a material of which only the glow is known.

    Examples
    --------
    >>> import labrig
    >>> from labrig.material import Albedo
    >>> from labrig.report import surface_lines
    >>> grey = Albedo(wavelength_nm=(400.0, 700.0), value=(0.2, 0.2), sigma=(0.01, 0.01))
    >>> material = labrig.read_material("blue-paint").model_copy(update={"albedo": grey})
    >>> for line in surface_lines(material):
    ...     print(line.partition(",")[0])
      albedo 0.200 ± 0.010 (450 nm)
    """
    return tuple(_surface_lines(material))


def _surface_lines(material: Material) -> Iterator[str]:
    if material.scale is not None:
        yield f"  scale: {material.scale}"
    for factor in material.scale_factors:
        value = _value_text(factor.value, math.nan if factor.sigma is None else factor.sigma)
        yield f"    × {value}{'' if factor.unit == '1' else ' ' + factor.unit}: {factor.name}"
    if material.albedo is not None:
        yield f"  albedo {_curve_text(material.albedo)}"
    if material.radiance_factor is not None:
        lamp = material.radiance_factor.lamp
        yield f"  radiance factor under {lamp} {_curve_text(material.radiance_factor)}"
    if material.thickness_mm is not None:
        yield f"  thickness {rounded(material.thickness_mm)} mm"
    if material.mass_per_area_g_per_m2 is not None:
        yield f"  mass per area {rounded(material.mass_per_area_g_per_m2)} g/m²"


def _curve_text(curve: Albedo | RadianceFactor) -> str:
    """Return a curve at some wavelengths as text."""
    parts = []
    for nm in ALBEDO_NM:
        if curve.wavelength_nm[0] <= nm <= curve.wavelength_nm[-1]:
            value = float(np.interp(nm, curve.wavelength_nm, curve.value))
            sigma = math.nan
            if curve.sigma is not None:
                sigma = float(np.interp(nm, curve.wavelength_nm, curve.sigma))
            parts.append(f"{_value_text(value, sigma)} ({nm:g} nm)")
    return ", ".join(parts)


def comparison_table(comparison: MaterialComparison) -> Table:
    """Return the table of the comparison of two materials, for the report and the terminal.

    Parameters
    ----------
    comparison
        Pairs of a measured and a reference value, from `compare_materials`.

    Returns
    -------
    Table
        Measured and reference value of every quantity and their difference in per cent and in σ;
        its caption has the factors that rescale k_e and Λ, and the notes.

    Examples
    --------
    >>> import labrig
    >>> from labrig.material import compare_materials
    >>> from labrig.report import comparison_table
    >>> measured = labrig.read_material("material.yaml")
    >>> reference = labrig.read_material("white-paint")
    >>> for row in comparison_table(compare_materials(measured, reference)).rows:
    ...     print("; ".join(row))
    k_r 1 / s⁻¹; 0.2048 ± 0.0031; 0.047; +335.7; +51.7
    k_r 2 / s⁻¹; 0.01009 ± 0.00012; –; –; –
    """
    return Table(
        head=("", _measured_head(comparison), "reference", "apart / %", "apart / σ"),
        rows=tuple(
            (
                f"{pair.quantity} / {pair.unit}" if pair.unit else pair.quantity,
                _value_text(pair.measured, pair.sigma),
                _value_text(pair.reference, pair.reference_sigma),
                _signed_text(pair.percent),
                _signed_text(pair.in_sigma),
            )
            for pair in comparison.pairs
        ),
        caption=" ".join(
            [
                f"k_e is relative to how bright the lamp was: the measured one is multiplied "
                f"by {rounded(comparison.k_e_factor)}, by least squares over bands and states."
                if any(pair.quantity.startswith("k_e") for pair in comparison.pairs)
                else "",
                f"Λ is relative: the measured one is multiplied by "
                f"{rounded(comparison.reradiation_factor)}, by least squares over bands and states."
                if any(pair.quantity.startswith("Λ") for pair in comparison.pairs)
                else "",
                *comparison.notes,
            ]
        ).strip(),
    )


def _measured_head(comparison: MaterialComparison) -> str:
    """Return the head of the column of measured values."""
    factors = (comparison.k_e_factor, comparison.reradiation_factor)
    return "measured" if factors == (1.0, 1.0) else "measured, rescaled"


def _rows(
    states: Sequence[State], bands_nm: Sequence[float], scale: str | None
) -> Iterator[tuple[str, ...]]:
    """Yield the rows of k_r, kinetic order, r(0), and k_e and Λ by band."""
    amplitude_unit, reradiation_unit = UNITS[scale]
    own = [("k_r / s⁻¹", "k_r_per_s"), ("r(0)", "r0")]
    if any(state.kinetic_order != 1 or state.kinetic_order_limit_95 for state in states):
        own.insert(1, ("kinetic order b", "kinetic_order"))
    for quantity, name in own:
        if any(getattr(state, name) is not None for state in states):
            yield (quantity, *(_quantity_text(state, name) for state in states))
    if any(state.decay_time_of_rate_s is not None for state in states):
        for quantity, name in ((f"a{amplitude_unit}", "amplitude"), ("τ / s", "decay_time_s")):
            yield (quantity, *(_quantity_text(state, name) for state in states))
        yield ("p", *map(_exponent_text, states))
    for symbol, unit, name in (
        ("k_e", " / s⁻¹", "k_e_per_s"),
        ("Λ", reradiation_unit, "reradiation"),
    ):
        if any(getattr(state, name) is not None for state in states):
            for band, (low, high) in enumerate(pairwise(bands_nm)):
                quantity = f"{symbol} {low:g}–{high:g} nm{unit}"
                yield (quantity, *(_quantity_text(state, name, band) for state in states))


def _quantity_text(state: State, name: str, band: int | None = None) -> str:
    """Return a quantity of a state as text, in a band if there are bands.

    Its range by the thickness of the sample, if it has one, stands before value and σ. What is at
    its bound is text of its limit.
    """
    value, sigma = state.known(name), getattr(state, f"{name}_sigma")
    if name == "decay_time_s" and value is None:
        value = state.decay_time_of_rate_s
    if value is None:
        return UNKNOWN
    if name == "kinetic_order" and state.kinetic_order_limit_95 is not None:
        order_sigma = abs(state.kinetic_order_limit_95 - value) / ONE_SIDED_SIGMAS
        return OneSided(value, order_sigma, limit=state.kinetic_order_limit_95).plus_minus
    if band is not None:
        value, sigma = value[band], None if sigma is None else sigma[band]
    text = _value_text(value, math.nan if sigma is None else sigma)
    if sigma and (value == 0 or (name == "r0" and value == 1)):
        return OneSided.held(value, sigma, 0.0, is_upper=value == 1).plus_minus
    if band is None:
        return text
    ends = getattr(state, f"{name}_range")
    if ends is None or ends[0][band] == ends[1][band]:
        return text
    return f"{rounded(ends[0][band], 3)} to {rounded(ends[1][band], 3)}, {text}"


def _exponent_text(state: State) -> str:
    """Return p = b/(b − 1) with its σ as text."""
    beyond, sigma = state.kinetic_order - 1, state.kinetic_order_sigma
    if beyond == 0:
        return UNKNOWN
    return _value_text(
        state.kinetic_order / beyond, math.nan if sigma is None else sigma / beyond**2
    )


def _value_text(value: float, sigma: float) -> str:
    """Return a value with its σ as text; NaN stands for an unknown value or σ."""
    if math.isnan(value):
        return UNKNOWN
    return rounded(value) if math.isnan(sigma) else plus_minus(value, sigma)


def _signed_text(number: float) -> str:
    """Return a number as text with its sign."""
    if not math.isfinite(number):
        return UNKNOWN
    text = f"{number:+.1f}"
    return "0.0" if float(text) == 0 else text.replace("-", "−")
