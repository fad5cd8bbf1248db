"""Variants of a protocol, each predicted as if it had been asked about."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from labrig.acquire import ProtocolModel, RigFile, plan
from labrig.errors import UsageError
from labrig.predict.expectation import Bench, expect, predictable
from labrig.predict.patch import PatchPrediction, predicted_patches
from labrig.predict.variants import Change, changed

#: A change that leaves more than this of σ does not help.
HELPS = 0.95
#: This is half: dark frames are not taken anew for each decay, so that 4 of them fall just short.
HALF = 0.52
#: Most changes taken together, and which of them cost next to no lab time.
MOST_TOGETHER = 3
CHEAP = 0.1


@dataclass(frozen=True)
class Remedy:
    """A change of the protocol, what it comes to and what it costs.

    Attributes
    ----------
    change
        Of the protocol.
    patches
        What their fits will then know.
    gain
        σ of the rates over what it was, the geometric mean of all.
    extra_time_s
        Lab time beyond the protocol's own.
    """

    change: Change
    patches: Mapping[str, PatchPrediction]
    gain: float
    extra_time_s: float

    @property
    def helps(self) -> bool:
        """Whether it makes a difference."""
        return self.gain <= HELPS

    @property
    def halves(self) -> bool:
        """Whether it leaves half of σ or less."""
        return self.gain <= HALF


@dataclass(frozen=True)
class Trials:
    """What changes are measured against: a protocol on a bench, and what it will know."""

    protocol: ProtocolModel
    rig: RigFile
    source: str
    bench: Bench
    base: Mapping[str, PatchPrediction]
    duration_s: float

    def remedies(self, ideas: Iterable[Change]) -> tuple[Remedy, ...]:
        """Those of the changes that can be made, the best first; some of them together, too."""
        alone = [remedy for idea in ideas if (remedy := self.remedy(idea)) is not None]
        alone.sort(key=lambda remedy: remedy.gain)
        cheap = [one for one in alone if one.extra_time_s <= CHEAP * self.duration_s]
        found = {one.change.says: one for one in (*alone, *self._stack(cheap))}
        if not any(remedy.halves for remedy in found.values()):
            found |= {one.change.says: one for one in self._stack(alone)}
        return tuple(sorted(found.values(), key=lambda remedy: remedy.gain))

    def remedy(self, change: Change) -> Remedy | None:
        """What `change` comes to; None if camera, frame or timing do not allow it."""
        try:
            variant = changed(self.protocol, change.keys)
            laid_out = plan(variant, self.rig, self.source)
            patches = predicted_patches(expect(predictable(variant), laid_out.offers, self.bench))
        except (ValidationError, UsageError):
            return None
        return Remedy(
            change,
            patches,
            _geometric_mean_ratio(_rate_sigmas(patches), _rate_sigmas(self.base)),
            laid_out.duration_s - self.duration_s,
        )

    def _stack(self, remedies: Sequence[Remedy]) -> list[Remedy]:
        """The best change with the next best on top, until half is reached; empty for one alone."""
        helpful = [remedy for remedy in remedies if remedy.helps]
        if not helpful:
            return []
        stacked, height = helpful[0], 1
        for one in helpful[1:]:
            if stacked.halves or height == MOST_TOGETHER:
                break
            if one.change.contradicts(stacked.change):
                continue
            both = self.remedy(stacked.change & one.change)
            if both is not None and both.gain <= HELPS * stacked.gain:
                stacked, height = both, height + 1
        return [stacked] if height > 1 else []


def _rate_sigmas(patches: Mapping[str, PatchPrediction]) -> list[float]:
    return [sigma for patch in patches.values() for sigma in patch.k_r_sigma_per_s]


def _geometric_mean_ratio(after: Sequence[float], before: Sequence[float]) -> float:
    """Of σ that may be infinite: what was unknown and is still so has not changed."""
    ratios = [
        new / old if np.isfinite(old) else float(not np.isfinite(new)) or 1e-3
        for new, old in zip(after, before, strict=True)
    ]
    return float(np.exp(np.mean(np.log(ratios))))
