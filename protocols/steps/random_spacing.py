"""Random spacing of photographs, so that no periodic flicker beats with them.

A flicker of period P looks like a slow change in frames that begin every Δ ≈ P, and cannot be
separated from the decay afterwards. Random begins turn it into noise (H. S. Shapiro, R. A.
Silverman, Journal of SIAM 8, 225, 1960). Exposure and readout keep two begins apart by a time g.
Frames that are shifted one by one within what is left, Δ − g, keep |sinc((Δ − g)/P)| of the beat:
half of it and more. So it is the pauses that are random, and the frames lose the step with any
flicker. What a pause has beyond g is distributed exponentially, as in a Poisson process, which
leaves least of a beat; but long pauses, in which a fast state would go unseen, are cut off.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from labrig.acquire import CameraCapabilities
from labrig.foundation.quantity import duration_text

#: Spacing of the begins of photographs.
Spacing = Literal["random", "even"]
#: Seed of a schedule that is predicted before a run has drawn one.
PLANNED_SEED = 0
#: Fraction of the time that readout leaves between two frames which metered exposures may take.
EXPOSED = 0.5
#: Longest random part of a pause in units of its exponential distribution, and its mean: no pause
#: is longer than about twice the mean one.
LONGEST = 2.0
MEAN = 1 - LONGEST / np.expm1(LONGEST)
#: Frequencies of a flicker that are looked at, per frame, of which the worst one is stated.
FREQUENCIES = np.linspace(0.5, 2.5, 401)


@dataclass(frozen=True)
class RandomSpacing:
    """Random begins of frames.

    Attributes
    ----------
    every_s
        Mean time between two begins in seconds.
    spent_s
        Time from the end of an exposure to the next begin, at least, in seconds.
    """

    every_s: float
    spent_s: float

    def longest_exposure_s(self, capabilities: CameraCapabilities) -> float:
        """Return the longest shutter time with which enough is left to chance, in seconds."""
        return capabilities.exposure_at_most(EXPOSED * (self.every_s - self.spent_s))

    def free_s(self, exposure_s: float) -> float:
        """Return the mean time in seconds between two begins that is left to chance."""
        return max(self.every_s - self.spent_s - exposure_s, 0.0)

    def begins_s(
        self, even_s: Sequence[float], exposures_s: Sequence[float], seed: int
    ) -> list[float]:
        """Return random begins in place of even ones, the first and the last as they are.

        Parameters
        ----------
        even_s
            Begins in seconds, `every_s` apart, shape (n,).
        exposures_s
            Shutter times in seconds, shape (n,).
        seed
            Seed of the random numbers.

        Returns
        -------
        list of float
            Begins in seconds, rising, shape (n,).

        Examples
        --------
        >>> from labrig.protocols.steps.random_spacing import RandomSpacing
        >>> spacing = RandomSpacing(every_s=5.0, spent_s=1.7)
        >>> [round(t_s, 1) for t_s in spacing.begins_s([0.5, 5.5, 10.5, 15.5], [0.3] * 4, seed=1)]
        [0.5, 4.7, 13.0, 15.5]
        """
        free_s = np.array([self.free_s(exposure_s) for exposure_s in exposures_s[:-1]])
        if len(free_s) < 2 or not free_s.any():
            return list(even_s)
        below = np.random.default_rng(seed).uniform(0.0, -np.expm1(-LONGEST), len(free_s))
        beyond = -np.log1p(-below)
        beyond *= free_s.sum() / (free_s @ beyond)
        pauses_s = self.every_s - free_s + free_s * beyond
        between_s = even_s[0] + np.cumsum(pauses_s[:-1])
        return [even_s[0], *between_s.tolist(), even_s[-1]]

    def beat_left(self, exposure_s: float, frames: int) -> float:
        """Return the fraction of a periodic flicker that looks like a slow change.

        It is the root mean square over all draws of |Σ exp(2πi f t)|/n at the worst frequency f,
        times what an exposure leaves. Pauses are independent, so that pairs of frames contribute
        powers φ^k of a pause's characteristic function φ. Independent noise would leave 1/√n.
        """
        free = self.free_s(exposure_s) / self.every_s
        if free == 0:
            return self.beat_of_even(exposure_s)
        phase = 2j * np.pi * FREQUENCIES
        beyond = 1 - phase * free / MEAN
        pause = np.exp(phase * (1 - free)) / beyond
        pause *= np.expm1(-LONGEST * beyond) / np.expm1(-LONGEST)
        # Σ (n − k) φ^k over k = 1 … n − 1, of frames that are k pauses apart.
        pairs = pause * (frames * (1 - pause) - (1 - pause**frames)) / (1 - pause) ** 2
        square = np.clip((frames + 2 * pairs.real) / frames**2, 0.0, 1.0)
        averaged = np.sinc(FREQUENCIES * exposure_s / self.every_s)
        return float(np.max(np.abs(averaged) * np.sqrt(square)))

    def beat_of_even(self, exposure_s: float) -> float:
        """Return the same of evenly spaced frames: what exposures leave of the period `every_s`."""
        return float(np.abs(np.sinc(exposure_s / self.every_s)))

    def lines(self, exposure_s: float, frames: int) -> tuple[str, str]:
        """Return for a plan how random the begins are, and what that leaves of a flicker."""
        every, least_s = duration_text(self.every_s), self.every_s - self.free_s(exposure_s)
        random, even = self.beat_left(exposure_s, frames), self.beat_of_even(exposure_s)
        return (
            f"random, every {every} in the mean and at least {duration_text(round(least_s, 2))} "
            "apart",
            f"of a flicker near {every}, {100 * random:.0f} % looks like decay; evenly spaced, "
            f"{100 * even:.0f} %",
        )

    def even_lines(self, exposure_s: float) -> tuple[str, str]:
        """Return for a plan what evenly spaced frames leave of a flicker."""
        every = duration_text(self.every_s)
        return (
            f"even, every {every}",
            f"of a flicker near {every}, {100 * self.beat_of_even(exposure_s):.0f} % looks like "
            "decay",
        )
