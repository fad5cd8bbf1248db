"""The doors of a simulated room: the trap door, the shield before the lamp."""

from collections.abc import Callable, Sequence

import numpy as np

from labrig.foundation.clock import VirtualClock

from .bench_settings import DoorSettings
from .boards import Pulse
from .door import FRAME_S, Door, DoorDrive
from .faults import Fault, given
from .simulation import Simulation

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
