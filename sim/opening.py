"""A simulated room with its doors open: boards on serial lines, a camera on USB."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

import usb.backend

from labrig.clock import VirtualClock
from labrig.yaml_file import validate

from . import protocol_sim
from .boards import NumatoBoard
from .camera import SimulatedCamera
from .protocol_sim import Board
from .room import Room
from .simulation import Simulation

#: The address of the room: `sim://room/relays`, `sim://room/camera`.
NAME = "room"
#: Relay that carries the lamp.
LAMP_RELAY = 0
RELAYS = 8


class OpenRoom:
    """The room, its clock and what stands in it."""

    def __init__(self, simulation: Simulation, clock: VirtualClock) -> None:
        self.clock = clock
        self.seed = simulation.seed
        self.room = Room(simulation, clock)
        relays = NumatoBoard(RELAYS, self._relay_moved)
        relays.states[LAMP_RELAY] = self.room.lamp_on
        self.boards: dict[str, Board] = {"relays": relays}
        self.camera = SimulatedCamera(clock, self.room, serial="0730100001", seed=simulation.seed)

    def usb(self, device: str) -> usb.backend.IBackend | None:
        """The USB bus on which `device` is alone; `None` if there is no such device."""
        return self.camera.backend if device == "camera" else None

    def _relay_moved(self, relay: int, on: bool) -> None:
        if relay == LAMP_RELAY:
            self.room.switch_lamp(on)


@contextmanager
def open_room(
    content: Mapping[str, Any], source: str, not_before_s: float = 0.0
) -> Iterator[OpenRoom]:
    """Build the room that a rig file's `simulation:` describes and make it reachable.

    Parameters
    ----------
    source
        Path of the rig file, for messages.
    not_before_s
        Seconds since 1970; the room's epoch is moved there if it is earlier.

    Raises
    ------
    UsageError
        The description does not fit.
    """
    simulation = validate(content, Simulation, f"{source}, simulation")
    if simulation.epoch.timestamp() < not_before_s:
        later = datetime.fromtimestamp(not_before_s, UTC)
        simulation = simulation.model_copy(update={"epoch": later})
    room = OpenRoom(simulation, VirtualClock(simulation.epoch.timestamp()))
    protocol_sim.open_door(NAME, room)
    try:
        yield room
    finally:
        protocol_sim.close_door(NAME)
