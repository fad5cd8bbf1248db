"""The camera's live picture: mirror up, a stream of JPEGs inside Canon's records."""

import math
import struct
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.clock import Clock

from ..photograph import Sensor

#: Time from the command to the first picture: mirror up, shutter open, sensor running.
START_S = 0.4
#: Interval of live pictures.
PICTURE_S = 1 / 30
#: EVF output to the PC; the camera's own display is 1.
TO_PC = 2

_JPEG, _ZOOM = 1, 4
_JPEG_QUALITY = 85


@runtime_checkable
class LiveSensor(Protocol):
    """A sensor that also has a live view."""

    def preview(self, at_s: float) -> NDArray[np.uint8]:
        """Return the live picture at a time, shape (height, width, 3): R, G, B for a display."""
        ...


class Viewfinder:
    """Live view of one camera.

    Parameters
    ----------
    clock
        The room's clock.
    sensor
        Sensor; one that is no `LiveSensor` never has a picture ready.
    """

    def __init__(self, clock: Clock, sensor: Sensor) -> None:
        self._clock = clock
        self._sensor = sensor
        self._ready_s = math.inf

    def send_to(self, output: int) -> None:
        """Set the EVF output."""
        if output != TO_PC:
            self._ready_s = math.inf
        elif self._ready_s == math.inf:
            self._ready_s = self._clock.now() + START_S

    def records(self) -> bytes | None:
        """Return the data of GetViewFinderData, or None while there is no picture."""
        now_s = self._clock.now()
        if now_s < self._ready_s or not isinstance(self._sensor, LiveSensor):
            return None
        rgb = self._sensor.preview(now_s - now_s % PICTURE_S)
        _, jpeg = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        # A camera sends more than the picture, such as the magnification; a host passes over it.
        return _record(_ZOOM, struct.pack("<I", 1)) + _record(_JPEG, jpeg.tobytes())


def _record(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", 8 + len(data), kind) + data
