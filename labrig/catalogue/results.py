"""The results in a run folder, read back from their files."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from labrig.errors import DataError


@dataclass(frozen=True)
class Measured:
    """A value and its σ, in the same unit."""

    value: float
    sigma: float

    def times(self, other: "Measured") -> "Measured":
        """Their product, independent of each other."""
        sigma = math.hypot(self.sigma * other.value, self.value * other.sigma)
        return Measured(self.value * other.value, sigma)

    def over(self, other: "Measured") -> "Measured":
        """Their ratio, independent of each other."""
        return self.times(Measured(1 / other.value, other.sigma / other.value**2))


@dataclass(frozen=True)
class PatchResult:
    """What was fitted to one patch; its name is empty where the run has only one.

    Attributes
    ----------
    rates
        k_r of every state in 1/s, falling.
    amplitudes
        Of the same states, in DN/s of the brightest channel.
    weights
        How bright each channel is by its name; 1 is the brightest.
    """

    name: str
    rates: tuple[Measured, ...]
    amplitudes: tuple[Measured, ...]
    weights: Mapping[str, Measured]
    warnings: tuple[str, ...]

    @property
    def brightest(self) -> str:
        """The channel in whose DN/s amplitudes are given."""
        return max(self.weights, key=lambda channel: self.weights[channel].value)

    def amplitudes_in(self, channel: str) -> tuple[Measured, ...]:
        """Amplitudes in another channel's DN/s.

        Raises
        ------
        DataError
            The camera has no such channel.
        """
        if channel not in self.weights:
            raise DataError(
                f"expected the same channels in both runs, got {channel} in one of them and "
                f"{', '.join(self.weights)} in the other"
            )
        return tuple(amplitude.times(self.weights[channel]) for amplitude in self.amplitudes)


def read_results(run: Path, result: str = "result") -> tuple[PatchResult, ...]:
    """The fits in a run's latest result, or in an earlier one; none if it was not processed.

    Raises
    ------
    DataError
        A fit.json is damaged.
    """
    folder = run / result
    return tuple(
        _read(path, "" if path.parent == folder else path.parent.name)
        for path in sorted(folder.rglob("fit.json"))
    )


def _read(path: Path, name: str) -> PatchResult:
    try:
        fit = json.loads(path.read_text(encoding="utf-8"))
        states = fit["states"]
        return PatchResult(
            name=name,
            rates=tuple(_measured(s["k_r_per_s"], s["k_r_sigma_per_s"]) for s in states),
            amplitudes=tuple(_measured(s["amplitude"], s["amplitude_sigma"]) for s in states),
            weights={
                channel: _measured(weight, fit["channel_weights_sigma"][channel])
                for channel, weight in fit["channel_weights"].items()
            },
            warnings=tuple(fit["warnings"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(
            f"{path}: expected a fit as labrig writes it, got something else ({error!r}); make it "
            f"again: labrig process {path.parent}"
        ) from None


def _measured(value: float, sigma: float | None) -> Measured:
    """JSON has no infinity: what nothing is known of is null there."""
    return Measured(float(value), math.inf if sigma is None else float(sigma))
