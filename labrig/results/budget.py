"""Budget of the uncertainty of a number by its causes, in one type for every result."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from labrig.foundation.number_format import digits_of_range, plus_minus, rounded
from labrig.results.measured import Measured

#: Wavelengths in nm near which a spectrum has headline values.
HEADLINE_NM = (450.0, 550.0, 650.0)
#: Name of noise and calibration where a result has their sum only.
UNDIVIDED = "noise and calibration"


@dataclass(frozen=True)
class Budget:
    """Uncertainty of a value by its causes, each a standard uncertainty in the unit of the value.

    The components are independent: σ is the root of the sum of their squares. A component that was
    not measured or does not apply is None, never 0, and `not_included` names it. Where a choice of
    model leaves a range instead of a σ, the range is beside σ and not in it.

    Attributes
    ----------
    value
        The value, in `unit`.
    unit
        Its unit; empty for a pure number.
    noise
        By the scatter of what was measured: photons, read noise, flicker, repetition.
    calibration
        By the calibrations and references that all readings share.
    undivided
        By noise and calibration together, where the result does not keep them apart.
    model
        By the choice among models that describe the readings.
    model_range
        Least and largest value that the choice of model leaves, without σ.
    model_of
        Cause of `model` or `model_range`, such as the thickness of the layer.
    left_out
        Further causes, by name, that are in no component.

    Examples
    --------
    >>> from labrig.results import Budget
    >>> budget = Budget(20.0, "mcd/m²", noise=0.3, calibration=0.4)
    >>> budget.sigma, budget.not_included
    (0.5, ('model',))
    >>> print(budget)
    20.00 ± 0.50 mcd/m² (noise 1.5 %, calibration 2 %; not included: model)
    """

    value: float
    unit: str = ""
    noise: float | None = None
    calibration: float | None = None
    undivided: float | None = None
    model: float | None = None
    model_range: tuple[float, float] | None = None
    model_of: str = ""
    left_out: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        stated: Measured,
        calibration: float | None = None,
        *,
        model_range: tuple[float, float] | None = None,
        model_of: str = "",
        left_out: Sequence[str] = (),
    ) -> Self:
        """Return the budget of a value whose stated σ is noise and, where given, a calibration.

        The noise is the part of σ that the calibration leaves, so that nothing counts twice.

        Parameters
        ----------
        stated
            Value and σ as they are stated.
        calibration
            The part of that σ which is the calibration's, at most all of it; None if none is.
        model_range, model_of, left_out
            As the attributes.
        """
        noise = stated.sigma
        if calibration is not None:
            calibration = min(calibration, stated.sigma)
            if math.isfinite(stated.sigma):
                noise = math.sqrt(stated.sigma**2 - calibration**2)
        return cls(
            stated.value,
            stated.unit,
            noise=noise,
            calibration=calibration,
            model_range=model_range,
            model_of=model_of,
            left_out=tuple(left_out),
        )

    @property
    def components(self) -> Mapping[str, float]:
        """Standard uncertainties by cause, of those that are included."""
        parts = {
            "noise": self.noise,
            "calibration": self.calibration,
            UNDIVIDED: self.undivided,
            "model": self.model,
        }
        return {cause: sigma for cause, sigma in parts.items() if sigma is not None}

    @property
    def sigma(self) -> float:
        """Root of the sum of squares of the components; infinite without any."""
        parts = self.components.values()
        return math.hypot(*parts) if parts else math.inf

    @property
    def not_included(self) -> tuple[str, ...]:
        """Names of the causes that are in no component."""
        missing = [] if self.undivided is not None else ["noise", "calibration"]
        missing += ["model"] if self.model_range is None else []
        return (*(cause for cause in missing if cause not in self.components), *self.left_out)

    @property
    def trusted(self) -> tuple[float, float]:
        """Range of the value by the choice of model, widened by one σ at both ends."""
        low, high = self.model_range or (self.value, self.value)
        return min(low, self.value) - self.sigma, max(high, self.value) + self.sigma

    def size_text(self, sigma: float) -> str:
        """Return a component in per cent of the value, or in its unit where it exceeds the value.

        Parameters
        ----------
        sigma
            The component, in the unit of the value.
        """
        if not math.isfinite(sigma):
            return "not known"
        if sigma < abs(self.value):
            return f"{rounded(100 * sigma / abs(self.value), 2)} %"
        return f"{rounded(sigma, 2)} {self.unit}".strip()

    @property
    def value_text(self) -> str:
        """Value, σ and unit as text."""
        return " ".join(filter(None, (plus_minus(self.value, self.sigma), self.unit)))

    @property
    def model_text(self) -> str:
        """The range by the choice of model as text; empty without one."""
        if self.model_range is None:
            return ""
        digits = digits_of_range(*self.model_range, self.value)
        low, high = (rounded(end, digits) for end in self.model_range)
        return " ".join(filter(None, (f"{low} to {high}", self.unit, f"by {self.model_of}")))

    def __str__(self) -> str:
        """Return the range by the model, if there is one, then value, σ and its causes."""
        causes = ", ".join(
            f"{name} {self.size_text(part)}" for name, part in self.components.items()
        )
        missing = f"not included: {', '.join(self.not_included)}" if self.not_included else ""
        inside = "; ".join(filter(None, (causes, missing)))
        return "; ".join(filter(None, (self.model_text, f"{self.value_text} ({inside})")))

    def to_dict(self) -> dict[str, Any]:
        """Return the content for a file, the range by the model before σ."""
        return {
            "value": self.value,
            "unit": self.unit,
            "model_range": self.model_range and list(self.model_range),
            "model_of": self.model_of,
            "sigma": self.sigma,
            "noise": self.noise,
            "calibration": self.calibration,
            "undivided": self.undivided,
            "model": self.model,
            "not_included": list(self.not_included),
        }


def named(patch: str, quantity: str) -> str:
    """Return the name of a patch's headline value; the only patch may have no name."""
    return f"{patch}: {quantity}" if patch else quantity
