"""The DeviceInfo dataset (PIMA 15740, 5.5.1): identity and abilities of the camera."""

import struct
from dataclasses import dataclass

from .failures import MalformedError


class DatasetReader:
    """Reader of one field of a dataset after the other.

    Parameters
    ----------
    data
        Bytes of the whole dataset.
    name
        Name of the dataset in messages.
    """

    def __init__(self, data: bytes, name: str) -> None:
        self._data = data
        self._name = name
        self._position = 0

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes.

        Raises
        ------
        MalformedError
            Fewer bytes are left; all other methods raise it, too.
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
        """Return numbers of the format in `struct`'s letters."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def codes(self) -> tuple[int, ...]:
        """Return an array of u16 numbers."""
        (count,) = self.numbers("I")
        return struct.unpack(f"<{count}H", self.take(2 * count))

    def text(self) -> str:
        """Return a string, without characters that cannot be printed."""
        units = self.take(2 * self.take(1)[0])
        decoded = units.decode("utf-16-le", errors="replace").partition("\0")[0]
        return "".join(letter for letter in decoded if letter.isprintable()).strip()


@dataclass(frozen=True)
class DeviceInfo:
    """Identity and abilities of the camera, as it reports them.

    Attributes
    ----------
    operations, events, properties
        Codes of the operations, events and properties that the camera has.
    capture_formats
        Codes of the formats in which the camera can photograph.
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
    """Return the DeviceInfo in the data phase of GetDeviceInfo.

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
