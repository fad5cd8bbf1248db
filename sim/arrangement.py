"""What the changer has arranged on the bench, and since when."""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

Card = Literal["sample", "grey card", "colorchecker", "blank"]
LvfPlace = Literal["away", "before camera", "on sample"]
LampKind = Literal["halogen", "mercury"]

#: Where the lamp stands unless the changer moves it.
USUAL_LAMP_M = 1.0


@dataclass(frozen=True)
class Arrangement:
    """One state of the bench.

    Attributes
    ----------
    card
        What lies there. `blank` is in the samples' place; grey card and ColorChecker lie on the
        closed door's outside, or without a door on the samples.
    lvf
        Where the linear variable filter is.
    turned
        Whether it was put there the wrong way round.
    filter
        The colour filter before the lamp.
    lamp
        Which one the relay feeds.
    lamp_m
        Its distance from the sample.
    tilt_deg
        Of the sample against the camera's axis.
    """

    card: Card = "sample"
    lvf: LvfPlace = "away"
    turned: bool = False
    filter: str | None = None
    lamp: LampKind = "halogen"
    lamp_m: float = USUAL_LAMP_M
    tilt_deg: int = 0


@dataclass(frozen=True)
class Arrangements:
    """All states of the bench up to now; values never change, `changed` gives new ones.

    Attributes
    ----------
    since_s
        When each began on the room's clock, rising, the first at 0.
    states
        As many.
    """

    since_s: tuple[float, ...] = (0.0,)
    states: tuple[Arrangement, ...] = (Arrangement(),)

    @property
    def last(self) -> Arrangement:
        """As it is now."""
        return self.states[-1]

    def changed(self, now_s: float, **what: Any) -> "Arrangements":
        """With one more change, of those fields of an `Arrangement`."""
        after = replace(self.last, **what)
        if after == self.last:
            return self
        if now_s <= self.since_s[-1]:
            return Arrangements(self.since_s, (*self.states[:-1], after))
        return Arrangements((*self.since_s, now_s), (*self.states, after))

    def at(self, time_s: float) -> Arrangement:
        """The state at a time; from the moment of a change on it is the new one."""
        return self.states[bisect_right(self.since_s, time_s) - 1]

    def spans(self, start_s: float, end_s: float) -> Iterator[tuple[float, float, Arrangement]]:
        """Beginning, end and state of every part of an interval in which nothing changes."""
        changes = [time_s for time_s in self.since_s if start_s < time_s < end_s]
        for left, right in pairwise([start_s, *changes, end_s]):
            yield left, right, self.at(left)
