"""The circuit from the relay board's register to the filament: contact and bulb, with faults."""

from collections.abc import Sequence

from labrig.foundation.clock import VirtualClock

from .arrangement import LampKind
from .faults import Fault, FaultTime, given
from .lamp import Lamp, Mercury
from .simulation import LampSettings


class LampCircuit:
    """The lamp behind its relay.

    Nothing runs in the background: the states of contact and bulb are computed when they are asked
    for.

    Parameters
    ----------
    settings
        Settings of the lamp.
    register_on
        State of the register when the room is opened.
    faults
        Faults of the room, of which `lamp_dead`, `mercury_dead`, `relay_dead` and `relay_welded`
        are the circuit's.
    clock
        The room's clock.
    """

    def __init__(
        self,
        settings: LampSettings,
        register_on: bool,
        faults: Sequence[Fault],
        clock: VirtualClock,
    ) -> None:
        self._clock = clock
        self._bulb_dead = given(fault.lamp_dead for fault in faults)
        self._mercury_dead = given(fault.mercury_dead for fault in faults)
        self._dead = given(fault.relay_dead for fault in faults)
        self._welded = given(fault.relay_welded for fault in faults)
        changes = {
            time_s
            for span in (*self._bulb_dead, *self._mercury_dead, *self._dead, *self._welded)
            for time_s in (span.at, span.until)
        }
        self._changes_s = sorted(time_s for time_s in changes if time_s > 0)
        self._register_on = register_on
        # Welded before the room was opened: it was closed then, and has not let go.
        self._closed = any(span.at < 0 and span.is_on(0.0) for span in self._welded)
        self._closed = self._contact(0.0)
        self._plugged: LampKind = "halogen"
        self._lamp = Lamp.found(settings, self._closed and not _any(self._bulb_dead, 0.0))
        self._mercury = Mercury()

    @property
    def closed(self) -> bool:
        """Whether the contact is closed now, so that the lamp has current if its bulb is whole."""
        self._follow()
        return self._closed

    @property
    def lamp(self) -> Lamp:
        """The halogen lamp with its history up to now."""
        self._follow()
        return self._lamp

    @property
    def mercury(self) -> Mercury:
        """The mercury lamp with its history up to now."""
        self._follow()
        return self._mercury

    def plug(self, lamp: LampKind) -> None:
        """Connect another lamp to the relay, now."""
        self._follow()
        self._plugged = lamp
        self._settle(self._clock.now())

    def ask(self, on: bool) -> None:
        """Change the board's register now."""
        self._follow()
        self._register_on = on
        self._settle(self._clock.now())

    def _follow(self) -> None:
        while self._changes_s and self._changes_s[0] <= self._clock.now():
            self._settle(self._changes_s.pop(0))

    def _settle(self, time_s: float) -> None:
        self._closed = self._contact(time_s)
        halogen = self._closed and self._plugged == "halogen"
        self._lamp = self._lamp.switched(halogen and not _any(self._bulb_dead, time_s), time_s)
        mercury = self._closed and self._plugged == "mercury"
        arc = mercury and not _any(self._mercury_dead, time_s)
        self._mercury = self._mercury.switched(arc, time_s)

    def _contact(self, time_s: float) -> bool:
        stuck = self._closed and _any(self._welded, time_s)
        return stuck or (self._register_on and not _any(self._dead, time_s))


def _any(fault_times: Sequence[FaultTime], time_s: float) -> bool:
    return any(span.is_on(time_s) for span in fault_times)
