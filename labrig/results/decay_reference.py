"""Timing of a decay: when its amplitudes hold, and flicker that its frames do not resolve."""

from dataclasses import dataclass

from labrig.foundation.number_format import rounded


@dataclass(frozen=True)
class DecayReference:
    """Time at which amplitudes hold and from which laws of decay count.

    Attributes
    ----------
    is_lamp_off
        Whether it is lamp off; else it is the first row, since the clock tells nothing of lamp off.
    t_s
        The time as those that were fitted count: 0 at lamp off.
    clock_s
        The same time by the clock of the table, in seconds.
    """

    is_lamp_off: bool = True
    t_s: float = 0.0
    clock_s: float = 0.0

    @property
    def name(self) -> str:
        """The time in a few words, `lamp off` or `the first row`."""
        return "lamp off" if self.is_lamp_off else "the first row"

    def __str__(self) -> str:
        """Return the time in words; of the first row with the clock's time."""
        return self.name if self.is_lamp_off else f"{self.name}, at {self.clock_s:.12g} s"


def first_row_at(t_s: float) -> DecayReference:
    """Return the reference at a first row whose time is that of the table's clock.

    Parameters
    ----------
    t_s
        Time of the first row in seconds.

    Returns
    -------
    DecayReference
        The reference.

    Examples
    --------
    >>> from labrig.results import first_row_at
    >>> str(first_row_at(9000.0))
    'the first row, at 9000 s'
    """
    return DecayReference(is_lamp_off=False, t_s=t_s, clock_s=t_s)


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
