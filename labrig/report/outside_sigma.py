"""What may change rates and amplitudes without a trace in the data, in sentences for each patch.

These are statements, with the sizes, and no warnings: the room may have been steady, and the sample
may have no such state.
"""

from collections.abc import Callable

from labrig.results import (
    WORTH_A_WORD,
    DecayPatch,
    DecayResult,
    change_text,
    largest_in_sigma,
)


def unrecorded_temperature(result: DecayResult) -> tuple[str, ...]:
    """Return a sentence for each patch of which a drift of the temperature would matter."""
    return _of_patches(result, _temperature)


def unseen_states(result: DecayResult) -> tuple[str, ...]:
    """Return a sentence for each patch of which a state that is gone too soon would matter."""
    return _of_patches(result, lambda patch: patch.fit.outside_sigma if patch.fit else "")


def _of_patches(result: DecayResult, sentence: Callable[[DecayPatch], str]) -> tuple[str, ...]:
    sentences = ((name, sentence(patch)) for name, patch in result.patches.items())
    return tuple(
        f"{name}: {text}" if len(result.patches) > 1 else text for name, text in sentences if text
    )


def _temperature(patch: DecayPatch) -> str:
    if patch.drift_effect is None or patch.fit is None:
        return ""
    of_rates, of_amplitudes = patch.drift_effect.T
    rates = [(state.k_r_per_s, state.k_r_sigma_per_s) for state in patch.fit.states]
    amplitudes = [(state.amplitude, state.amplitude_sigma) for state in patch.fit.states]
    in_sigma = max(
        largest_in_sigma(of_rates, rates)[1], largest_in_sigma(of_amplitudes, amplitudes)[1]
    )
    if in_sigma < WORTH_A_WORD:
        return ""
    return (
        "the temperature was not recorded: 1 K in an hour, with traps 0.65 eV deep, would change "
        f"rates by up to {change_text(of_rates, rates)} and amplitudes by up to "
        f"{change_text(of_amplitudes, amplitudes)}, which is not in σ; a thermometer in the rig "
        "would tell"
    )
