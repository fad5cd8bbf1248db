"""Arrangements of the bench by the changer, and their times."""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

Card = Literal["sample", "lit sample", "grey card", "colorchecker", "blank"]
LvfPlace = Literal["away", "before camera", "on sample"]
LampKind = Literal["halogen", "mercury"]

#: Where the lamp stands unless the changer moves it.
USUAL_LAMP_M = 1.0
#: Angle between light and camera unless the changer turns the light.
USUAL_LIGHT_DEG = 45


@dataclass(frozen=True)
class Arrangement:
    """One state of the bench.

    Attributes
    ----------
    card
        Object that is laid out. `blank` is in the samples' place; grey card and ColorChecker lie on
        the closed door's outside, or without a door on the samples. `lit sample` are the samples
        themselves on the closed door's outside, where lamp and camera both see them.
    lvf
        Place of the linear variable filter.
    turned
        Whether the filter was put there the wrong way round.
    filter
        Name of the colour filter before the lamp.
    wheel
        Name of the filter that the filter wheel has before the lamp.
    camera_filter, camera_wheel
        Names of the colour filter before the camera, and of the one that the wheel there has.
    is_monochromatic
        Whether the monochromator is between lamp and sample.
    monochromator_nm
        Wavelength to which it is tuned, in nm; null while its shutter is closed.
    lamp
        Lamp that the relay feeds.
    lamp_m
        Distance of the lamp from the sample in metres.
    tilt_deg
        Angle of the sample against the camera's axis in degrees.
    light_deg
        Angle between light and camera, seen from the sample, in degrees.
    placing
        Number of times that the sample was put in anew.
    faced
        Sample that the spectrometer faces, from 1 on, while the samples lie open; 0 is a white
        reference beside them.
    chart_patch
        Patch of the ColorChecker, from 1 on, that lies so near that it alone fills the frame; 0 is
        the whole chart in its place.
    in_place
        Sample of the sample changer that is in the light, from 1 on; 0 is none.
    """

    card: Card = "sample"
    lvf: LvfPlace = "away"
    turned: bool = False
    filter: str | None = None
    wheel: str | None = None
    camera_filter: str | None = None
    camera_wheel: str | None = None
    is_monochromatic: bool = False
    monochromator_nm: float | None = None
    lamp: LampKind = "halogen"
    lamp_m: float = USUAL_LAMP_M
    tilt_deg: int = 0
    light_deg: int = USUAL_LIGHT_DEG
    placing: int = 0
    faced: int = 0
    chart_patch: int = 0
    in_place: int = 0

    def with_sample(self, number: int) -> "Arrangement":
        """Return the arrangement with another sample of the sample changer in place."""
        return self if number == self.in_place else replace(self, in_place=number)


@dataclass(frozen=True)
class Arrangements:
    """All states of the bench up to now; values never change, `changed` gives new ones.

    Attributes
    ----------
    since_s
        Start of each state on the room's clock in seconds, rising, the first at 0.
    states
        State of the bench since each of these times.
    """

    since_s: tuple[float, ...] = (0.0,)
    states: tuple[Arrangement, ...] = (Arrangement(),)

    @property
    def last(self) -> Arrangement:
        """Present state of the bench."""
        return self.states[-1]

    def changed(self, now_s: float, **what: Any) -> "Arrangements":
        """Return the arrangements with one more change, of those fields of an `Arrangement`."""
        changed = replace(self.last, **what)
        if changed == self.last:
            return self
        if now_s <= self.since_s[-1]:
            return Arrangements(self.since_s, (*self.states[:-1], changed))
        return Arrangements((*self.since_s, now_s), (*self.states, changed))

    def at(self, time_s: float) -> Arrangement:
        """Return the state at a time; from the moment of a change on it is the new one."""
        return self.states[bisect_right(self.since_s, time_s) - 1]

    def spans(self, start_s: float, end_s: float) -> Iterator[tuple[float, float, Arrangement]]:
        """Yield begin, end and state of every part of an interval in which nothing changes."""
        changes = [time_s for time_s in self.since_s if start_s < time_s < end_s]
        for begin_s, stop_s in pairwise([start_s, *changes, end_s]):
            yield begin_s, stop_s, self.at(begin_s)
