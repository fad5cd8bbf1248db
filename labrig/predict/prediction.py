"""Predicted uncertainties of a protocol's fits, and changes that would reduce them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

from labrig.acquire import Plan, ProtocolModel, RigFile
from labrig.predict.assumptions import Sources, collect_assumptions
from labrig.predict.expectation import expect, predictable
from labrig.predict.patch import PatchPrediction, predicted_patches
from labrig.predict.remedies import Remedy, Trials
from labrig.predict.variants import changes


@dataclass(frozen=True)
class Prediction:
    """Expected uncertainties of a protocol's fits.

    Attributes
    ----------
    patches
        Predictions by patch.
    materials
        Names of the materials by patch.
    exposures_s
        Exposure times of the frames of one decay in seconds.
    decays
        Number of decays that share one fit.
    remedies
        Changes of the protocol, those with the largest gain first.
    brightness_known
        Patches whose amplitudes are measured; those of the others are assumed.
    notes
        Origins of the assumed figures.
    warnings
        Warnings that the protocol's metering will give.
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
        """Return the prediction as JSON; infinite values are null."""
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
                    "change": remedy.change.description,
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
    """Predict the uncertainties of a decay protocol on a rig, and of variants of the protocol.

    Parameters
    ----------
    protocol
        Protocol that records a decay.
    laid_out
        Plan of the protocol on the rig.
    rig
        Rig file with the devices.
    source
        Name or path of the rig file, for messages.
    sources
        Materials of the patches, and the sources of noise and brightness.

    Returns
    -------
    Prediction
        Expected standard uncertainties of rates and amplitudes, error budget, and variants of the
        protocol by the gain that they bring.

    Raises
    ------
    UsageError
        If the protocol records no decay, if there is no such patch, material or run, or if no decay
        can be predicted for the material.

    Notes
    -----
    The uncertainties are those of the best unbiased estimator, the inverse of the Fisher
    information (Cramér–Rao bound) of the decay model of `labrig.fit`.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.predict import Sources, predict
    >>> protocol = labrig.read_protocol(Path("runs/decay/protocol.yaml"))
    >>> rig = labrig.read_rig_file(Path("runs/decay/rig.yaml"))
    >>> plan = labrig.plan(protocol, rig, "rig.yaml")
    >>> prediction = predict(protocol, plan, rig, "rig.yaml", Sources({"": "blue-paint"}))
    >>> patch = prediction.patches["sample"]
    >>> f"k_r = {patch.rate_per_s[0]} ± {patch.rate_sigma_per_s[0]:.0e} 1/s"
    'k_r = 0.032 ± 6e-05 1/s'
    >>> prediction.remedies[0].change.description
    'for: 3 min'
    """
    decay = predictable(protocol)
    assumptions = collect_assumptions(protocol, laid_out.offers, sources)
    expectation = expect(decay, laid_out.offers, assumptions.bench)
    base = predicted_patches(expectation)
    trials = Trials(protocol, rig, source, assumptions.bench, base, laid_out.duration_s)
    return Prediction(
        patches=base,
        materials=assumptions.materials,
        exposures_s=expectation.exposures_s,
        decays=decay.repeats,
        remedies=trials.remedies(changes(decay, laid_out.offers, base)),
        brightness_known=assumptions.brightness_known,
        notes=assumptions.notes,
        warnings=expectation.warnings,
    )
