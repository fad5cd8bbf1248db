"""What a decay fit found."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from labrig.errors import FitError
from labrig.fit.decay.rivals import Rival
from labrig.fit.decay.selection import Candidate
from labrig.fit.decay.shapes import exponential_means
from labrig.fit.least_squares import FloatArray


@dataclass(frozen=True)
class DecayState:
    """One exponential a e^(−k t); its σ are standard uncertainties.

    Attributes
    ----------
    k_r_per_s, k_r_sigma_per_s
        Rate; σ 0 if it was held.
    amplitude, amplitude_sigma
        At lamp off, in the brightest channel, in the values' units.
    """

    k_r_per_s: float
    k_r_sigma_per_s: float
    amplitude: float
    amplitude_sigma: float


@dataclass(frozen=True)
class DecayFit:
    """Σ_i a_i e^(−k_i t) times one weight per channel, plus its offset; with uncertainties.

    Attributes
    ----------
    states
        By falling rate.
    channels, channel_weights, channel_weights_sigma
        Names, weights (maximum 1, which is held), their σ.
    offsets, offsets_sigma
        Of the channels, in the values' units; σ 0 if held at 0.
    repeats, levels
        Names of the charges, and how bright the decay after each was over their mean.
    flicker, flicker_sigma
        Relative noise common to the channels of a frame; σ 0 if given.
    chi2, dof
        Sum of squared residuals in units of the noise, and its degrees of freedom.
    bic
        χ² + parameters · log(independent data).
    covariance
        Rows of k1, a1, k2, a2, …, offset of the brightest channel; channel weights and the others'
        offsets marginalised.
    warnings
        What to distrust, and what to do about it.
    candidates
        The numbers of states tried.
    rivals
        Power law and stretched exponential, fitted to the same series.
    better_rival
        The one of them that does clearly better than exponentials, if one does.
    residuals, normalised_residuals
        Value − model, one row per frame in the order given, one column per channel: in the values'
        units, and whitened (independent, unit variance if the noise is as assumed).
    """

    states: tuple[DecayState, ...]
    channels: tuple[str, ...]
    channel_weights: tuple[float, ...]
    channel_weights_sigma: tuple[float, ...]
    offsets: tuple[float, ...]
    offsets_sigma: tuple[float, ...]
    repeats: tuple[str, ...]
    levels: tuple[float, ...]
    flicker: float
    flicker_sigma: float
    chi2: float
    dof: int
    bic: float
    covariance: FloatArray
    warnings: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    rivals: tuple[Rival, ...]
    better_rival: Rival | None
    residuals: FloatArray
    normalised_residuals: FloatArray

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def brightest(self) -> int:
        """The channel of weight 1, in whose units the amplitudes are."""
        return int(np.argmax(self.channel_weights))

    @property
    def offset(self) -> float:
        """Of the brightest channel."""
        return self.offsets[self.brightest]

    @property
    def offset_sigma(self) -> float:
        """Of the brightest channel."""
        return self.offsets_sigma[self.brightest]

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom; NaN if there are none."""
        return self.chi2 / self.dof if self.dof > 0 else math.nan

    def predict(self, t_s: ArrayLike, exposure_s: ArrayLike = 0.0) -> FloatArray:
        """Mean signal during exposures, (n, C), offsets included.

        Parameters
        ----------
        t_s
            (n,) start of the exposures after lamp off, ≥ 0.
        exposure_s
            Their length ≥ 0, one for all or (n,).

        Raises
        ------
        FitError
            Shapes that do not agree.
        """
        t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        exposure = np.asarray(exposure_s, dtype=np.float64)
        if t.ndim != 1 or exposure.shape not in {(), t.shape}:
            raise FitError(
                f"expected times (n,) and one exposure or (n,), got {t.shape} and "
                f"{exposure.shape}; give one exposure per time"
            )
        rates = np.array([state.k_r_per_s for state in self.states])
        amplitudes = np.array([state.amplitude for state in self.states])
        signal = exponential_means(rates, t, np.broadcast_to(exposure, t.shape)) @ amplitudes
        predicted: FloatArray = np.multiply.outer(signal, self.channel_weights) + self.offsets
        return predicted

    def to_json(self) -> str:
        """The text of `fit.json`; what is not finite is null."""
        fields: dict[str, Any] = {
            "n_states": self.n_states,
            "states": [asdict(state) for state in self.states],
            "channel_weights": self._by_channel(self.channel_weights),
            "channel_weights_sigma": self._by_channel(self.channel_weights_sigma),
            "offset": self.offset,
            "offset_sigma": self.offset_sigma,
            "offsets": self._by_channel(self.offsets),
            "offsets_sigma": self._by_channel(self.offsets_sigma),
            "levels": dict(zip(self.repeats, self.levels, strict=True)),
            "flicker": self.flicker,
            "flicker_sigma": self.flicker_sigma,
            "chi2": self.chi2,
            "dof": self.dof,
            "reduced_chi2": self.reduced_chi2,
            "bic": self.bic,
            "covariance": self.covariance.tolist(),
            "warnings": list(self.warnings),
            "candidates": [asdict(candidate) for candidate in self.candidates],
            "rivals": [asdict(rival) for rival in self.rivals],
            "better_rival": self.better_rival.name if self.better_rival else None,
        }
        return json.dumps(_finite(fields), indent=2, ensure_ascii=False, allow_nan=False)

    def __str__(self) -> str:
        """A table for people; digits in brackets are σ in units of the last places."""
        rows = [
            [
                str(number),
                with_uncertainty(state.k_r_per_s, state.k_r_sigma_per_s),
                with_uncertainty(1 / state.k_r_per_s, state.k_r_sigma_per_s / state.k_r_per_s**2),
                with_uncertainty(state.amplitude, state.amplitude_sigma),
            ]
            for number, state in enumerate(self.states, start=1)
        ]
        lines = _table([["state", "k / s⁻¹", "1/k / s", "amplitude"], *rows])
        lines.append(f"weights  {self._written(self.channel_weights, self.channel_weights_sigma)}")
        if any(self.offsets_sigma):
            lines.append(f"offsets  {self._written(self.offsets, self.offsets_sigma)}")
        if len(self.repeats) > 1:
            pairs = zip(self.repeats, self.levels, strict=True)
            lines.append(f"levels   {', '.join(f'{name} {level:.4f}' for name, level in pairs)}")
        if self.flicker or self.flicker_sigma:
            percent = with_uncertainty(100 * self.flicker, 100 * self.flicker_sigma)
            lines.append(f"flicker  {percent} %")
        lines.append(f"reduced χ² {self.reduced_chi2:.3g} ({self.dof} dof), BIC {self.bic:.1f}")
        lines += [f"! {warning}" for warning in self.warnings]
        return "\n".join(lines)

    def _by_channel(self, values: tuple[float, ...]) -> dict[str, float]:
        return dict(zip(self.channels, values, strict=True))

    def _written(self, values: tuple[float, ...], sigmas: tuple[float, ...]) -> str:
        return ", ".join(
            f"{name} {with_uncertainty(value, sigma)}"
            for name, value, sigma in zip(self.channels, values, sigmas, strict=True)
        )


def with_uncertainty(value: float, sigma: float) -> str:
    """`0.0802(13)`: the value to two digits of its σ; `0.08` if σ is 0, `0.08(?)` if unknown."""
    if sigma == 0:
        return f"{value:.6g}"
    if not math.isfinite(sigma):
        return f"{value:.3g}(?)"
    decimals = 1 - math.floor(math.log10(sigma))
    digits = round(sigma * 10.0**decimals)
    if digits == 100:
        decimals, digits = decimals - 1, 10
    if decimals > 8:
        exponent = math.floor(math.log10(abs(value))) if value else 0
        if exponent < -3:
            return f"{with_uncertainty(value / 10.0**exponent, sigma / 10.0**exponent)}e{exponent}"
    if decimals < 0:
        return f"{round(value, decimals):.0f}({digits * 10**-decimals})"
    # σ of 1 and more is written with its decimal point, as in 12.5(1.3).
    bracket = f"{sigma:.{decimals}f}" if decimals > 0 and sigma >= 1 else str(digits)
    return f"{value:.{decimals}f}({bracket})"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _finite(item: Any) -> Any:
    """JSON knows no infinity and no NaN."""
    if isinstance(item, dict):
        return {key: _finite(value) for key, value in item.items()}
    if isinstance(item, list):
        return [_finite(value) for value in item]
    if isinstance(item, float) and not math.isfinite(item):
        return None
    return item
