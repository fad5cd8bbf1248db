"""Tasks of the changer in the simulated room: cards, filters, lamps, the LVF."""

import re
from collections.abc import Callable, Mapping

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
from .faults import given
from .filters import Filters
from .simulation import Simulation

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
