"""Size of a simulated camera's frames, and the time, before its room is opened."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from labrig.foundation.yaml_file import validate
from labrig.material import read_any_material

from .dng import Shot, encode_dng
from .simulation import EMPTY, Simulation


@dataclass(frozen=True)
class RoomDescription:
    """Frames of a simulated camera, and the room's time.

    Attributes
    ----------
    frame_pixels
        Width and height of a frame in pixels.
    frame_bytes
        Size of a frame's file in bytes.
    epoch_s
        Time in seconds since 1970 at which the room opens.
    """

    frame_pixels: tuple[int, int]
    frame_bytes: int
    epoch_s: float


def describe_room(content: Mapping[str, Any], source: str) -> RoomDescription:
    """Check the description of a simulated room and describe its camera's frames.

    Parameters
    ----------
    content
        Content of the rig file's `simulation:`, as YAML loads it.
    source
        Path of the rig file, for messages.

    Returns
    -------
    RoomDescription
        Size of the frames, and the room's epoch.

    Raises
    ------
    UsageError
        The description does not fit the model `Simulation`, or a material is unknown or malformed.

    Examples
    --------
    >>> from labrig.sim import describe_room
    >>> describe_room({"sample": "blue-paint", "sensor": {"width": 384, "height": 64}}, "rig.yaml")
    RoomDescription(frame_pixels=(384, 64), frame_bytes=..., epoch_s=...)
    """
    simulation = validate(content, Simulation, f"{source}, simulation")
    for table in simulation.tables():
        for patch in table.patches:
            if patch.material != EMPTY:
                read_any_material(patch.material)
    width, height = simulation.sensor.width, simulation.sensor.height
    lens = None if simulation.lens is None else simulation.lens.notes
    file = encode_dng(np.zeros((height, width), np.uint16), Shot(0.0, 1.0, 100, 4.0, lens))
    return RoomDescription((width, height), len(file), simulation.epoch.timestamp())
