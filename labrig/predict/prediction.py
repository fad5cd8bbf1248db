"""Predicted uncertainties of a protocol's fits, and changes that would reduce them."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from labrig.acquire import Plan, ProtocolModel, RigFile, plan
from labrig.foundation.errors import UsageError
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.result_warning import ResultWarning
from labrig.predict.assumptions import Sources, collect_assumptions
from labrig.predict.expectation import Bench, expect, predictable
from labrig.predict.patch import STATE_HEAD, PatchPrediction, predicted_patches
from labrig.predict.variants import Change, changed, changes

#: Largest ratio of σ after over before a change that helps.
HELPS = 0.95
#: Ratio that counts as half: dark frames are shared, so that 4 decays fall just short of it.
HALF = 0.52
#: Largest number of combined changes, and fraction of the lab time up to which one is cheap.
MAX_TOGETHER = 3
CHEAP = 0.1


@dataclass(frozen=True)
class Remedy:
    """A change of the protocol with its effect and cost.

    Attributes
    ----------
    change
        Change of the protocol.
    patches
        Predictions by patch after the change.
    gain
        σ of the rates after over before the change, geometric mean over all rates.
    extra_time_s
        Additional lab time in seconds.
    """

    change: Change
    patches: Mapping[str, PatchPrediction]
    gain: float
    extra_time_s: float

    @property
    def helps(self) -> bool:
        """True if the change reduces σ noticeably."""
        return self.gain <= HELPS

    @property
    def halves(self) -> bool:
        """True if the change halves σ."""
        return self.gain <= HALF


@dataclass(frozen=True)
class Trials:
    """A protocol on a bench and its prediction, with which changes are compared."""

    protocol: ProtocolModel
    rig: RigFile
    source: str
    bench: Bench
    base: Mapping[str, PatchPrediction]
    duration_s: float

    def remedies(self, candidates: Iterable[Change]) -> tuple[Remedy, ...]:
        """Return the feasible changes and some combinations of them, the largest gain first."""
        single = [
            remedy for candidate in candidates if (remedy := self.remedy(candidate)) is not None
        ]
        single.sort(key=lambda remedy: remedy.gain)
        cheap = [remedy for remedy in single if remedy.extra_time_s <= CHEAP * self.duration_s]
        by_name = {
            remedy.change.description: remedy for remedy in (*single, *self._combined(cheap))
        }
        if not any(remedy.halves for remedy in by_name.values()):
            by_name |= {remedy.change.description: remedy for remedy in self._combined(single)}
        return tuple(sorted(by_name.values(), key=lambda remedy: remedy.gain))

    def remedy(self, change: Change) -> Remedy | None:
        """Return the effect of a change; None if camera, frame or timing do not allow it."""
        try:
            variant = changed(self.protocol, change.keys)
            laid_out = plan(variant, self.rig, self.source)
            patches = predicted_patches(
                expect(predictable(variant), laid_out.capabilities, self.bench)
            )
        except (ValidationError, UsageError):
            return None
        return Remedy(
            change,
            patches,
            _geometric_mean_ratio(_rate_sigmas(patches), _rate_sigmas(self.base)),
            laid_out.duration_s - self.duration_s,
        )

    def _combined(self, remedies: Sequence[Remedy]) -> list[Remedy]:
        """Return the best combination of changes, added until σ is halved; empty for one change."""
        helpful = [remedy for remedy in remedies if remedy.helps]
        if not helpful:
            return []
        combined, n_changes = helpful[0], 1
        for remedy in helpful[1:]:
            if combined.halves or n_changes == MAX_TOGETHER:
                break
            if remedy.change.contradicts(combined.change):
                continue
            trial = self.remedy(combined.change & remedy.change)
            if trial is not None and trial.gain <= HELPS * combined.gain:
                combined, n_changes = trial, n_changes + 1
        return [combined] if n_changes > 1 else []


def _rate_sigmas(patches: Mapping[str, PatchPrediction]) -> list[float]:
    return [sigma for patch in patches.values() for sigma in patch.rate_per_s_sigma]


def _geometric_mean_ratio(after: Sequence[float], before: Sequence[float]) -> float:
    """Return the geometric mean of ratios of σ; a σ that remains infinite counts as unchanged."""
    ratios = [
        new / old if np.isfinite(old) else float(not np.isfinite(new)) or 1e-3
        for new, old in zip(after, before, strict=True)
    ]
    return float(np.exp(np.mean(np.log(ratios))))


@dataclass(frozen=True)
class Prediction(NotebookViews):
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
    warnings: tuple[ResultWarning, ...]

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the states of all patches as `states.csv`, and the changes as `changes.csv`."""
        states = [
            (name, number, *values)
            for name, patch in self.patches.items()
            for number, values in enumerate(patch.states(), start=1)
        ]
        changes = [
            (remedy.change.description, remedy.gain, remedy.extra_time_s)
            for remedy in self.remedies
        ]
        return {
            "states.csv": CsvTable(("patch", "state", *STATE_HEAD), states),
            "changes.csv": CsvTable(("change", "σ after over before", "extra time (s)"), changes),
        }

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
            "warnings": [each.to_dict() for each in self.warnings],
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
    >>> f"k_r = {patch.rate_per_s[0]} ± {patch.rate_per_s_sigma[0]:.0e} 1/s"
    'k_r = 0.032 ± 6e-05 1/s'
    >>> prediction.remedies[0].change.description
    'for: 3 min'
    """
    decay = predictable(protocol)
    assumptions = collect_assumptions(protocol, laid_out.capabilities, sources)
    expectation = expect(decay, laid_out.capabilities, assumptions.bench)
    base = predicted_patches(expectation)
    trials = Trials(protocol, rig, source, assumptions.bench, base, laid_out.duration_s)
    return Prediction(
        patches=base,
        materials=assumptions.materials,
        exposures_s=expectation.exposures_s,
        decays=decay.repeats,
        remedies=trials.remedies(changes(decay, laid_out.capabilities, base)),
        brightness_known=assumptions.brightness_known,
        notes=assumptions.notes,
        warnings=expectation.warnings,
    )
