"""Periodic flicker that the times of frames do not distinguish from a slow change."""

from dataclasses import dataclass

from labrig.foundation.number_format import rounded


@dataclass(frozen=True)
class UnseenFlicker:
    """Periodic flicker that beats with evenly spaced frames; its effect is not in any σ.

    Attributes
    ----------
    period_s
        Longest period in seconds of which this is so; it is of its fractions, too.
    share
        Fraction of the flicker, from 0 to 1, that looks like a slow change: what the exposures do
        not average out.
    """

    period_s: float
    share: float

    def __str__(self) -> str:
        """Return what goes unseen, and how it would not, in a sentence without its stop."""
        return (
            f"a flicker with a period near {rounded(self.period_s, 3)} s or a fraction of it would "
            f"go unseen, since frames are spaced so evenly: up to {rounded(100 * self.share, 2)} % "
            "of it would look like a part of the decay; frames at random times would show it"
        )
