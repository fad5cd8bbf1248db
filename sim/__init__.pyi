from .description import (
    RoomDescription as RoomDescription,
    describe_room as describe_room,
)
from .opening import (
    OpenRoom as OpenRoom,
    open_room as open_room,
)
from .simulation import Simulation as Simulation
