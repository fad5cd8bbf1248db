from .opening import (
    OpenRoom as OpenRoom,
    RoomDescription as RoomDescription,
    describe_room as describe_room,
    open_room as open_room,
)
from .simulation import Simulation as Simulation
