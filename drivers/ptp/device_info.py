"""The DeviceInfo dataset (PIMA 15740, 5.5.1): who the camera is and what it can do."""

import struct
from dataclasses import dataclass

from .failures import MalformedError


@dataclass(frozen=True)
class DeviceInfo:
    """Who the camera is, from its own words.

    Attributes
    ----------
    operations
        Codes of the operations it knows.
    """

    manufacturer: str
    model: str
    version: str
    serial: str
    operations: frozenset[int]

    def __str__(self) -> str:
        maker = self.manufacturer.split(" ")[0]
        model = self.model if self.model.startswith(maker) else f"{maker} {self.model}"
        # Canon writes its protocol's version before the firmware's: 3-2.1.2
        firmware = self.version.rpartition("-")[2]
        return f"{model}, serial {self.serial or 'unknown'}, firmware {firmware or 'unknown'}"


def parse_device_info(data: bytes) -> DeviceInfo:
    """DeviceInfo from the data phase of GetDeviceInfo.

    Raises
    ------
    MalformedError
        The dataset is cut short.
    """
    reader = _Reader(data)
    reader.take(2 + 4 + 2)  # standard version, vendor extension and its version
    reader.text()  # vendor extension in words
    reader.take(2)  # functional mode
    operations = reader.codes()
    for _ in ("events", "properties", "capture formats", "image formats"):
        reader.codes()
    manufacturer, model, version, serial = (reader.text() for _ in range(4))
    return DeviceInfo(manufacturer, model, version, serial, frozenset(operations))


class _Reader:
    """Takes one field after the other."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._position = 0

    def take(self, size: int) -> bytes:
        piece = self._data[self._position : self._position + size]
        if len(piece) < size:
            raise MalformedError(
                f"the camera's DeviceInfo is cut short at byte {len(self._data)}: "
                "unplug it and plug it in again"
            )
        self._position += size
        return piece

    def codes(self) -> tuple[int, ...]:
        (count,) = struct.unpack("<I", self.take(4))
        return struct.unpack(f"<{count}H", self.take(2 * count))

    def text(self) -> str:
        units = self.take(2 * self.take(1)[0])
        words = units.decode("utf-16-le", errors="replace").partition("\0")[0]
        return "".join(letter for letter in words if letter.isprintable()).strip()
