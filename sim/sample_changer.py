"""The simulated sample changer: which of its samples is in the light, and when."""

from bisect import bisect_right
from collections.abc import Sequence

from .arrangement import Arrangements
from .doors import Pulses
from .simulation import SampleChangerSettings

#: A servo is at a place if its pulse is as near as this.
NEAR_S = 20e-6


class SampleHolder:
    """The disk or slide of a sample changer, moved by a servo, or by tasks where it has none.

    While it moves, no sample is in the light.

    Parameters
    ----------
    settings
        Settings of the changer; None if there is none.
    pulses
        Function of a channel that returns the pulses sent to its servo up to now.
    """

    def __init__(self, settings: SampleChangerSettings | None, pulses: Pulses) -> None:
        self._settings = settings
        self._pulses = pulses
        self._turned: list[tuple[float, int]] = [(0.0, 0)]
        self._merged: tuple[Arrangements, Sequence[tuple[float, int]], Arrangements] | None = None

    def turn(self, number: int, now_s: float) -> None:
        """Have a sample in place from now on, from 1 on; 0 is none."""
        self._turned.append((now_s, number))

    def with_places(self, arrangements: Arrangements) -> Arrangements:
        """Return the arrangements with the sample that is in place in each."""
        if self._settings is None:
            return arrangements
        places = self._places(self._settings)
        if self._merged is None or self._merged[:2] != (arrangements, places):
            self._merged = arrangements, places, _merged(arrangements, places)
        return self._merged[2]

    def _places(self, settings: SampleChangerSettings) -> list[tuple[float, int]]:
        """Return since when which sample has been in place."""
        if settings.channel is None:
            return list(self._turned)
        numbers = {place.pulse: number for number, place in enumerate(settings.places, start=1)}
        found = [(0.0, 0)]
        for at_s, width_s, ramp_s in self._pulses(settings.channel):
            if not width_s:  # without pulses a servo stays where it is
                continue
            near = (n for pulse_s, n in numbers.items() if abs(pulse_s - width_s) < NEAR_S)
            arrival_s = at_s + max(ramp_s, settings.travel) if at_s else 0.0
            found += [(at_s, 0), (arrival_s, next(near, 0))]
        return found


def _merged(arrangements: Arrangements, places: Sequence[tuple[float, int]]) -> Arrangements:
    """Return the arrangements at all times at which anything changes."""
    # A pulse that comes while the servo moves ends its way to the place before.
    until_s, rising = float("inf"), []
    for since_s, number in reversed(places):
        if since_s <= until_s:
            rising.append((since_s, number))
            until_s = since_s
    rising.reverse()
    begins_s = [since_s for since_s, _ in rising]
    times_s = sorted({*arrangements.since_s, *begins_s})
    numbers = [rising[bisect_right(begins_s, time_s) - 1][1] for time_s in times_s]
    states = [
        arrangements.at(time_s).with_sample(number)
        for time_s, number in zip(times_s, numbers, strict=True)
    ]
    return Arrangements(tuple(times_s), tuple(states))
