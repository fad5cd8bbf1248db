"""The DeviceInfo dataset (PIMA 15740, 5.5.1): who the camera is and what it can do."""

import struct
from dataclasses import dataclass

from .failures import MalformedError


class DatasetReader:
    """Takes one field after the other.

    Parameters
    ----------
    data
        The whole dataset.
    name
        What messages call it.
    """

    def __init__(self, data: bytes, name: str) -> None:
        self._data = data
        self._name = name
        self._position = 0

    def take(self, size: int) -> bytes:
        """The next `size` bytes.

        Raises
        ------
        MalformedError
            There are fewer, as in everything that follows.
        """
        piece = self._data[self._position : self._position + size]
        if len(piece) < size:
            raise MalformedError(
                f"the camera's {self._name} is cut short: expected {size} bytes from byte "
                f"{self._position} on",
                self._data,
            )
        self._position += size
        return piece

    def numbers(self, layout: str) -> tuple[int, ...]:
        """Numbers in `struct`'s letters."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def codes(self) -> tuple[int, ...]:
        """An array of u16."""
        (count,) = self.numbers("I")
        return struct.unpack(f"<{count}H", self.take(2 * count))

    def text(self) -> str:
        """A string, without what cannot be printed."""
        units = self.take(2 * self.take(1)[0])
        words = units.decode("utf-16-le", errors="replace").partition("\0")[0]
        return "".join(letter for letter in words if letter.isprintable()).strip()


@dataclass(frozen=True)
class DeviceInfo:
    """Who the camera is, from its own words.

    Attributes
    ----------
    operations, events, properties
        Codes of the operations it knows, of the events it reports, of the properties it has.
    capture_formats
        Codes of the formats in which it can photograph.
    """

    manufacturer: str
    model: str
    version: str
    serial: str
    operations: frozenset[int]
    events: frozenset[int]
    properties: frozenset[int]
    capture_formats: frozenset[int]

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
    reader = DatasetReader(data, "DeviceInfo")
    reader.take(2 + 4 + 2)  # standard version, vendor extension and its version
    reader.text()  # vendor extension in words
    reader.take(2)  # functional mode
    operations, events, properties, capture_formats = (frozenset(reader.codes()) for _ in range(4))
    reader.codes()  # image formats
    manufacturer, model, version, serial = (reader.text() for _ in range(4))
    return DeviceInfo(
        manufacturer, model, version, serial, operations, events, properties, capture_formats
    )
