"""Tasks of the changer in the simulated room, by hand or by a sample changer."""

import re
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence

from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UsageError

from .arrangement import (
    USUAL_LAMP_M,
    USUAL_LIGHT_DEG,
    Arrangement,
    Arrangements,
    Card,
    LampKind,
    LvfPlace,
)
from .cards import PATCHES
from .door import Pulses
from .faults import given
from .filters import Filters
from .simulation import SampleChangerSettings, Simulation

#: Largest angle of a sample against the camera's axis.
MAX_TILT_DEG = 85
#: Largest angle between light and camera.
MAX_LIGHT_DEG = 150
#: Least distance of a lamp from the sample.
MIN_LAMP_M = 0.2


class Changer:
    """Changer that arranges the bench, and sometimes makes mistakes.

    Parameters
    ----------
    simulation
        Settings of the room, with its faults.
    filters
        Filters that the changer has.
    clock
        The room's clock.
    freshen
        Function that puts another sample in.
    plug
        Function that connects another lamp to the relay.
    """

    def __init__(
        self,
        simulation: Simulation,
        filters: Filters,
        clock: VirtualClock,
        *,
        freshen: Callable[[], None],
        plug: Callable[[LampKind], None],
    ) -> None:
        self._samples = len(simulation.patches)
        self._has_lvf = simulation.lvf is not None
        self._has_monochromator = simulation.monochromator is not None
        self._turned = given(fault.lvf_turned for fault in simulation.faults)
        self._skipped = given(fault.filter_skipped for fault in simulation.faults)
        self._filters = filters
        self._clock = clock
        self._freshen = freshen
        self._plug = plug
        self._light_deg = simulation.light_deg
        self.arrangements = Arrangements(states=(Arrangement(light_deg=simulation.light_deg),))

    @property
    def tasks(self) -> Mapping[str, Callable[..., None]]:
        """Tasks by their command line; a word in capitals stands for a parameter."""
        return {
            "fresh sample": self._fresh_sample,
            "sample": lambda: self._lay("sample"),
            "lit sample": lambda: self._lay("lit sample"),
            "grey card": lambda: self._lay("grey card"),
            "colorchecker": lambda: self._lay("colorchecker"),
            "colorchecker NUMBER": self._lay_patch,
            "blank": lambda: self._lay("blank"),
            "lvf away": lambda: self._put_lvf("away"),
            "lvf before camera": lambda: self._put_lvf("before camera"),
            "lvf on sample": lambda: self._put_lvf("on sample"),
            "monochromator on": lambda: self._put_monochromator(True),
            "monochromator away": lambda: self._put_monochromator(False),
            "no filter": lambda: self._put_filter(None),
            "filter NAME": self._put_filter,
            "no camera filter": lambda: self._put_camera_filter(None),
            "camera filter NAME": self._put_camera_filter,
            "lamp halogen": lambda: self._change_lamp("halogen"),
            "lamp mercury": lambda: self._change_lamp("mercury"),
            "lamp at DISTANCE": self._move_lamp,
            "lamp back": lambda: self._change(lamp_m=USUAL_LAMP_M),
            "tilt DEGREES": self._tilt,
            "yarn vertical DEGREES": self._put_in_anew,
            "yarn horizontal DEGREES": self._put_in_anew,
            "sphere anew": lambda: self._put_in_anew(str(USUAL_LIGHT_DEG)),
            "light back": lambda: self._change(light_deg=self._light_deg),
            "sample NUMBER": self._face,
        }

    def _change(self, **what: object) -> None:
        self.arrangements = self.arrangements.changed(self._clock.now(), **what)

    def _fresh_sample(self) -> None:
        self._lay("sample")
        self._freshen()

    def _lay(self, card: Card) -> None:
        self._change(card=card, faced=0, chart_patch=0)

    def _lay_patch(self, number: str) -> None:
        if not number.isdecimal() or not 1 <= int(number) <= PATCHES:
            raise UsageError(f"expected a patch from 1 to {PATCHES}, got '{number}'")
        self._change(card="colorchecker", faced=0, chart_patch=int(number))

    def _face(self, number: str) -> None:
        if not number.isdecimal() or not 1 <= int(number) <= self._samples:
            raise UsageError(f"expected a sample from 1 to {self._samples}, got '{number}'")
        self._change(card="sample", faced=int(number))

    def _put_lvf(self, place: LvfPlace) -> None:
        if place != "away" and not self._has_lvf:
            raise UsageError("there is no LVF in this room, see 'simulation.lvf'")
        turned = any(span.is_on(self._clock.now()) for span in self._turned)
        self._change(lvf=place, turned=turned and place != "away")

    def _put_monochromator(self, on: bool) -> None:
        if on and not self._has_monochromator:
            raise UsageError("there is none in this room, see 'simulation.monochromator'")
        self._change(is_monochromatic=on)

    def turn_camera_wheel(self, name: str | None) -> None:
        """Have another filter of the wheel before the camera from now on."""
        self._change(camera_wheel=name)

    def turn_wheel(self, name: str | None) -> None:
        """Have another filter of the filter wheel before the lamp from now on."""
        self._change(wheel=name)

    def tune(self, wavelength_nm: float, is_open: bool) -> None:
        """Have the monochromator tuned to another wavelength, its shutter open or closed."""
        self._change(monochromator_nm=wavelength_nm if is_open else None)

    def _put_filter(self, name: str | None) -> None:
        if name is not None:
            self._filters.check(name)
        now_s = self._clock.now()
        for skipped in self._skipped:
            if skipped.is_on(now_s) and name is not None and skipped.name in (None, name):
                return
        self._change(filter=name)

    def _put_camera_filter(self, name: str | None) -> None:
        if name is not None:
            self._filters.check(name)
        self._change(camera_filter=name)

    def _change_lamp(self, lamp: LampKind) -> None:
        self._change(lamp=lamp)
        self._plug(lamp)

    def _move_lamp(self, distance: str) -> None:
        number, _, unit = distance.partition(" ")
        if unit != "m" or not re.fullmatch(r"\d+(\.\d+)?", number) or float(number) < MIN_LAMP_M:
            raise UsageError(
                f"expected {MIN_LAMP_M} m or more, such as '1.41 m' instead of the usual "
                f"{USUAL_LAMP_M:g} m, got '{distance}'"
            )
        self._change(lamp_m=float(number))

    def _tilt(self, degrees: str) -> None:
        if not degrees.isdecimal() or int(degrees) > MAX_TILT_DEG:
            raise UsageError(f"expected whole degrees from 0 to {MAX_TILT_DEG}, got '{degrees}'")
        self._change(tilt_deg=int(degrees))

    def _put_in_anew(self, light_degrees: str) -> None:
        """Put the sample in again, never quite as it was, and turn the light."""
        if not light_degrees.isdecimal() or int(light_degrees) > MAX_LIGHT_DEG:
            raise UsageError(
                f"expected whole degrees from 0 to {MAX_LIGHT_DEG}, got '{light_degrees}'"
            )
        placing = self.arrangements.last.placing + 1
        self._change(card="sample", light_deg=int(light_degrees), placing=placing)


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
