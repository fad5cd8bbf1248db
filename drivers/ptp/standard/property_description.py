"""The DevicePropDesc dataset (PIMA 15740, 13.3.3): a property's value and its choices."""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..device_info import DatasetReader
from ..failures import MalformedError

#: Letters of `struct` by data type code, for the whole numbers.
_LETTERS = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "q", 8: "Q"}
_RANGE, _ENUMERATION = 1, 2


@dataclass(frozen=True)
class PropertyDescription:
    """A property that is a whole number.

    Attributes
    ----------
    data_type
        Code of the number's size and sign.
    is_settable
        Whether the property can be set over the wire at all.
    value
        Value of the property now.
    choices
        Values that the camera lists for setting: a `range` where it gives bounds and a step. Empty
        where it gives none.
    """

    data_type: int
    is_settable: bool
    value: int
    choices: Sequence[int]

    def settable_to(self, candidates: Iterable[int]) -> Sequence[int]:
        """Return the camera's list; of bounds with a step, those of `candidates` that fit.

        A property that cannot be set, or has no list, offers its present value only.
        """
        if not self.is_settable or not self.choices:
            return (self.value,)
        if isinstance(self.choices, range):
            return [candidate for candidate in candidates if candidate in self.choices]
        return self.choices

    def encode(self, value: int) -> bytes:
        """Return the bytes of a value."""
        return struct.pack("<" + _LETTERS[self.data_type], value)

    def decode(self, data: bytes) -> int:
        """Return the value in bytes.

        Raises
        ------
        MalformedError
            The bytes do not fit the type that the camera reports.
        """
        letter = "<" + _LETTERS[self.data_type]
        if len(data) != struct.calcsize(letter):
            raise MalformedError(
                f"expected a value of {struct.calcsize(letter)} bytes (data type "
                f"0x{self.data_type:04X}) from the camera",
                data,
            )
        return int(struct.unpack(letter, data)[0])


def parse_property_description(data: bytes) -> PropertyDescription | None:
    """Return the description in the data phase of GetDevicePropDesc; None for no whole number.

    Raises
    ------
    MalformedError
        The dataset is cut short.
    """
    reader = DatasetReader(data, "DevicePropDesc")
    _code, data_type, get_set = reader.numbers("HHB")
    if (letter := _LETTERS.get(data_type)) is None:
        return None
    _factory_default, value = reader.numbers(2 * letter)
    (form,) = reader.numbers("B")
    choices: Sequence[int] = ()
    if form == _RANGE:
        lowest, highest, step = reader.numbers(3 * letter)
        choices = range(lowest, highest + 1, max(step, 1))
    elif form == _ENUMERATION:
        (count,) = reader.numbers("H")
        choices = reader.numbers(count * letter)
    return PropertyDescription(data_type, get_set == 1, value, choices)
