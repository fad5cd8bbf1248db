"""Sentences on what may change rates and amplitudes without a trace in the data, for each patch.

These are statements, with the sizes, and no warnings: the room may have been steady, and the sample
may have no such state.
"""

from collections.abc import Callable

from labrig.report.sections import Section
from labrig.results import DecayPatch, ResultWithDecays


def unrecorded_temperature(result: ResultWithDecays) -> tuple[str, ...]:
    """Return a sentence for each patch of which a drift of the temperature would matter."""
    return _of_patches(result, _temperature)


def outside_sections(result: ResultWithDecays) -> tuple[Section, ...]:
    """Return the section with all statements of a decay; empty if there are none."""
    unseen = _of_patches(result, lambda patch: patch.fit.outside_sigma if patch.fit else "")
    flicker = _of_patches(result, lambda patch: str((patch.fit and patch.fit.unseen_flicker) or ""))
    statements = (*unrecorded_temperature(result), *unseen, *flicker)
    if not statements:
        return ()
    text = tuple(f"{line[0].upper()}{line[1:]}." for line in statements)
    return (Section("Not in σ", text),)


def _of_patches(result: ResultWithDecays, sentence: Callable[[DecayPatch], str]) -> tuple[str, ...]:
    sentences = ((name, sentence(patch)) for name, patch in result.patches.items())
    return tuple(
        f"{name}: {text}" if len(result.patches) > 1 else text for name, text in sentences if text
    )


def _temperature(patch: DecayPatch) -> str:
    if patch.drift_effect is None or patch.fit is None:
        return ""
    changes = patch.fit.describe_changes(*patch.drift_effect.T.tolist())
    if not changes:
        return ""
    return (
        "the temperature was not recorded: 1 K in an hour, with traps 0.65 eV deep, would change "
        f"{changes}; a thermometer in the rig would tell"
    )
