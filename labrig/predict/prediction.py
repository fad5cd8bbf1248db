"""What a protocol's fits will know, and what would make them know more."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

from labrig.acquire import Plan, ProtocolModel, RigFile
from labrig.predict.assumptions import Sources, what_is_known
from labrig.predict.expectation import expect, predictable
from labrig.predict.patch import PatchPrediction, predicted_patches
from labrig.predict.remedies import Remedy, Trials
from labrig.predict.variants import changes


@dataclass(frozen=True)
class Prediction:
    """What a protocol's fits will know before it is run.

    Attributes
    ----------
    patches
        By name.
    materials
        Names by patch.
    exposures_s
        Of the frames of one decay.
    decays
        How many of them share one fit.
    remedies
        The best first; those that do not help last.
    brightness_known
        Patches whose amplitudes are as measured, the others' as assumed.
    notes, warnings
        Where the figures come from; what the protocol's metering will say.
    """

    patches: Mapping[str, PatchPrediction]
    materials: Mapping[str, str]
    exposures_s: tuple[float, ...]
    decays: int
    remedies: tuple[Remedy, ...]
    brightness_known: frozenset[str]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    def to_json(self) -> str:
        """For a program; what is infinite is null."""
        content = {
            "patches": {
                name: {
                    "material": self.materials[name],
                    "brightness_known": name in self.brightness_known,
                    **patch.to_json(),
                }
                for name, patch in self.patches.items()
            },
            "exposures_s": self.exposures_s,
            "decays": self.decays,
            "remedies": [
                {
                    "change": remedy.change.says,
                    "keys": remedy.change.keys,
                    "gain": remedy.gain,
                    "extra_time_s": remedy.extra_time_s,
                    "patches": {name: patch.to_json() for name, patch in remedy.patches.items()},
                }
                for remedy in self.remedies
            ],
            "notes": self.notes,
            "warnings": self.warnings,
        }
        return json.dumps(content, ensure_ascii=False)


def predict(
    protocol: ProtocolModel, laid_out: Plan, rig: RigFile, source: str, sources: Sources
) -> Prediction:
    """Expected uncertainties of `protocol` on `rig`, and of its variants.

    Parameters
    ----------
    laid_out
        The protocol's plan on that rig.
    source
        Names the rig in messages.
    sources
        What is on the bench, and where its figures are to come from.

    Raises
    ------
    UsageError
        The protocol records no decay, a patch, material or run does not exist, or the material is
        one of which no decay can be predicted.
    """
    asked = predictable(protocol)
    known = what_is_known(protocol, laid_out.offers, sources)
    expected = expect(asked, laid_out.offers, known.bench)
    base = predicted_patches(expected)
    trials = Trials(protocol, rig, source, known.bench, base, laid_out.duration_s)
    return Prediction(
        patches=base,
        materials=known.materials,
        exposures_s=expected.exposures_s,
        decays=asked.repeats,
        remedies=trials.remedies(changes(asked, laid_out.offers, base)),
        brightness_known=known.brightness_known,
        notes=known.notes,
        warnings=expected.warnings,
    )
