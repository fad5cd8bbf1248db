"""Effect of a temperature that nobody recorded, in a sentence for each patch."""

import numpy as np

from labrig.number_format import rounded
from labrig.results import DecayPatch, DecayResult, FittedDecay, FloatArray

#: Change in σ from which a drift of 1 K in an hour is worth a word.
WORTH_A_WORD = 0.3


def unrecorded_temperature(result: DecayResult) -> tuple[str, ...]:
    """Return a sentence for each patch of which a drift of the temperature would matter.

    It is a statement of what was not measured, with its size, and no warning: the room may have
    been steady.
    """
    sentences = ((name, _sentence(patch)) for name, patch in result.patches.items())
    return tuple(
        f"{name}: {text}" if len(result.patches) > 1 else text for name, text in sentences if text
    )


def _sentence(patch: DecayPatch) -> str:
    if patch.drift_effect is None or patch.fit is None:
        return ""
    in_sigmas = _in_sigmas(patch.drift_effect, patch.fit)
    if in_sigmas.max(initial=0.0) < WORTH_A_WORD:
        return ""
    rates, amplitudes = (
        f"{rounded(100 * abs(patch.drift_effect[row, column]), 2)} % "
        f"({rounded(float(in_sigmas[row, column]), 2)} σ)"
        for column, row in enumerate(in_sigmas.argmax(axis=0))
    )
    return (
        "the temperature was not recorded: 1 K in an hour, with traps 0.65 eV deep, would change "
        f"rates by up to {rates} and amplitudes by up to {amplitudes}, which is not in σ; a "
        "thermometer in the rig would tell"
    )


def _in_sigmas(effect: FloatArray, fit: FittedDecay) -> FloatArray:
    """Return the sizes of relative changes of rates and amplitudes in their σ, shape (n, 2)."""
    values = np.array([[state.k_r_per_s, state.amplitude] for state in fit.states])
    sigma = np.array([[state.k_r_sigma_per_s, state.amplitude_sigma] for state in fit.states])
    known = (sigma > 0) & np.isfinite(sigma)
    return np.asarray(np.where(known, abs(effect * values) / np.where(known, sigma, 1.0), 0.0))
