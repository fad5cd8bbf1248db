"""A door on a servo: travel, overshoot and ringing. The shield before the lamp is such a door, too.

The door swings by a quarter turn, evenly, and rings at the end as a damped spring does. Closed, its
sample faces the lamp, open, the camera: at an angle, the fraction cos² remains for the lamp and
sin² for the camera, so that a door beyond its end loses light as one that has not reached it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from labrig.foundation.clock import VirtualClock

from .bench_settings import DoorSettings
from .boards import Pulse
from .faults import Fault, FaultTime, Slowness, given
from .simulation import Simulation

#: A servo takes over a new pulse with its next frame.
FRAME_S = 0.02
#: Ringing below this part of a quarter turn is over: 2.5e-8 of the light.
AT_REST = 1e-4


@dataclass(frozen=True)
class _Swing:
    """Swing from angle `begin` to `end` from `start_s` on, 0 closed to 1 open; then ringing."""

    start_s: float
    begin: float
    end: float
    stop_s: float
    rest_s: float
    overshoot: float


@dataclass(frozen=True)
class Door:
    """A door with its history; values never change. Times are seconds of the room's clock."""

    settings: DoorSettings
    swings: tuple[_Swing, ...]

    @classmethod
    def found(cls, settings: DoorSettings, *, is_open: bool) -> Self:
        """Return a door that has been open, or closed, for long at time zero."""
        angle = float(is_open)
        return cls(settings, (_Swing(0.0, angle, angle, 0.0, 0.0, 0.0),))

    def sent(self, end: float, start_s: float, travel_s: float) -> "Door":
        """Return the door after it began, at `start_s`, to swing to the angle `end`."""
        begin = self.angle(start_s)
        if begin == end and self.is_still(start_s, start_s):
            return self
        overshoot = self.settings.overshoot * (end - begin)
        stop_s = start_s + travel_s
        ringing_s = self.settings.ringing * math.log(max(abs(overshoot) / AT_REST, 1.0))
        return self._with(_Swing(start_s, begin, end, stop_s, stop_s + ringing_s, overshoot))

    def held(self, start_s: float) -> "Door":
        """Return the door as if it were held in its position at `start_s`."""
        angle = self.angle(start_s)
        return self._with(_Swing(start_s, angle, angle, start_s, start_s, 0.0))

    def angle(self, time_s: float) -> float:
        """Return the angle in quarter turns: 0 closed, 1 open; ringing goes a little beyond."""
        swing = next(s for s in reversed(self.swings) if s.start_s <= time_s)
        if time_s >= swing.rest_s:
            return swing.end
        if time_s < swing.stop_s:
            progress = (time_s - swing.start_s) / (swing.stop_s - swing.start_s)
            return swing.begin + progress * (swing.end - swing.begin)
        rung_s = time_s - swing.stop_s
        fading = swing.overshoot * math.exp(-rung_s / self.settings.ringing)
        return swing.end + fading * math.sin(2 * math.pi * self.settings.ringing_hz * rung_s)

    def openness(self, time_s: float) -> float:
        """Return the fraction of the sample that the camera sees, 0 to 1."""
        return math.sin(math.pi / 2 * self.angle(time_s)) ** 2

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which the door's motion is not smooth."""
        times = {t for s in self.swings for t in (s.start_s, s.stop_s, s.rest_s)}
        return sorted(t for t in times if start_s < t < end_s)

    def is_still(self, start_s: float, end_s: float) -> bool:
        """Return whether the door stands still from `start_s` to `end_s`."""
        swing = next(s for s in reversed(self.swings) if s.start_s <= start_s)
        return start_s >= swing.rest_s and not self.corners(start_s, end_s)

    @property
    def settled_s(self) -> float:
        """Time at which the door comes to rest after the last command."""
        return self.swings[-1].rest_s

    def _with(self, swing: _Swing) -> "Door":
        earlier = tuple(s for s in self.swings if s.start_s < swing.start_s)
        return replace(self, swings=(*earlier, swing))


class DoorDrive:
    """The servo between a Maestro's pulses and the door, with faults of both.

    Nothing runs in the background: the door's position is computed when it is asked for.

    Parameters
    ----------
    settings
        Settings of the door.
    is_open
        Whether the door is open at the start.
    pulses
        Function that returns the pulses that the servo has been sent up to now.
    jitter_s
        Function of a command's time that returns the time until the servo's next frame.
    clock
        The room's clock.
    stuck, slow
        Times at which the door does not move, or takes long for the whole way.
    """

    def __init__(
        self,
        settings: DoorSettings,
        pulses: Callable[[], Sequence[Pulse]],
        jitter_s: Callable[[float], float],
        clock: VirtualClock,
        *,
        is_open: bool,
        stuck: Sequence[FaultTime] = (),
        slow: Sequence[Slowness] = (),
    ) -> None:
        self._settings = settings
        self._pulses = pulses
        self._jitter_s = jitter_s
        self._clock = clock
        self._stuck = stuck
        self._slow = slow
        changes = {time_s for span in stuck for time_s in (span.at, span.until)}
        self._changes_s = sorted(time_s for time_s in changes if time_s > 0)
        self._followed = len(pulses())
        self._goal = float(is_open)
        self._door = Door.found(settings, is_open=is_open)

    @property
    def door(self) -> Door:
        """The door with its history up to now, and its motion by the last pulse."""
        new = self._pulses()[self._followed :]
        self._followed += len(new)
        for pulse in new:
            self._go_through_changes(pulse.at_s)
            self._take(pulse)
        self._go_through_changes(self._clock.now())
        return self._door

    def _take(self, pulse: Pulse) -> None:
        if not pulse.width_s:
            return  # a servo without pulses stays where it is
        closed, width = self._settings.closed, self._settings.open - self._settings.closed
        self._goal = float(np.clip((pulse.width_s - closed) / width, 0.0, 1.0))
        self._swing(pulse.at_s + self._jitter_s(pulse.at_s), pulse.ramp_s)

    def _go_through_changes(self, until_s: float) -> None:
        while self._changes_s and self._changes_s[0] <= until_s:
            change_s = self._changes_s.pop(0)
            if self._is_stuck(change_s):
                self._door = self._door.held(change_s)
            else:
                self._swing(change_s, 0.0)

    def _swing(self, start_s: float, at_least_s: float) -> None:
        if self._is_stuck(start_s):
            return
        takes = [slow.takes for slow in self._slow if slow.is_on(start_s)]
        turn = abs(self._goal - self._door.angle(start_s))
        travel_s = max(max(takes, default=self._settings.travel) * turn, at_least_s)
        self._door = self._door.sent(self._goal, start_s, travel_s)

    def _is_stuck(self, time_s: float) -> bool:
        return any(span.is_on(time_s) for span in self._stuck)


#: Stream of random numbers drawn from the seed, beside the room's own.
SERVO_STREAM = 4

#: The pulses that a channel of the servo board has sent up to now.
Pulses = Callable[[int], Sequence[Pulse]]


def no_pulses(_: int) -> Sequence[Pulse]:
    """Return no pulses, as of a missing servo board."""
    return ()


class Doors:
    """Doors that a servo board swings; one that the settings do not have is None.

    Parameters
    ----------
    simulation
        Settings of the room; its door's faults are the trap door's.
    clock
        The room's clock.
    pulses
        Function of a channel that returns the pulses sent to its servo up to now.
    """

    def __init__(self, simulation: Simulation, clock: VirtualClock, pulses: Pulses) -> None:
        self._seed = simulation.seed
        self._clock = clock
        self._pulses = pulses
        is_open = simulation.initial.door == "open"
        self._trap_door = self._drive(simulation.door, simulation.faults, is_open=is_open)
        self._shield = self._drive(simulation.shield, (), is_open=True)

    @property
    def trap_door(self) -> Door | None:
        """The trap door with its history up to now."""
        return None if self._trap_door is None else self._trap_door.door

    @property
    def shield(self) -> Door | None:
        """The shield with its history up to now."""
        return None if self._shield is None else self._shield.door

    def _drive(
        self, settings: DoorSettings | None, faults: Sequence[Fault], *, is_open: bool
    ) -> DoorDrive | None:
        if settings is None:
            return None
        return DoorDrive(
            settings,
            lambda: self._pulses(settings.channel),
            lambda asked_s: self._frame_to_come_s(settings.channel, asked_s),
            self._clock,
            is_open=is_open,
            stuck=given(fault.door_stuck for fault in faults),
            slow=given(fault.door_slow for fault in faults),
        )

    def _frame_to_come_s(self, channel: int, asked_s: float) -> float:
        """Return the time until a servo takes over a pulse that was commanded at `asked_s`."""
        moment = round(self._clock.wall(asked_s) * 1e6)
        rng = np.random.default_rng([self._seed, SERVO_STREAM, channel, moment])
        return float(rng.uniform(0.0, FRAME_S))
