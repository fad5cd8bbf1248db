"""Properties of a camera without a maker's extension: asking, setting, reading back.

The DevicePropDesc dataset (PIMA 15740, 13.3.3) holds a property's value and its choices.
"""

import struct
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from labrig.foundation.clock import Clock

from ..codes import (
    ACCESS_DENIED,
    OPERATION_NOT_SUPPORTED,
    PROPERTY_NOT_SUPPORTED,
    Standard,
    StandardProperty,
)
from ..device_info import DatasetReader
from ..failures import MalformedError, RefusedError
from ..session import Session

POLL_PERIOD_S = 0.05
_NOT_TOLD = (OPERATION_NOT_SUPPORTED, PROPERTY_NOT_SUPPORTED, ACCESS_DENIED)


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


class StandardProperties:
    """Properties that are read from the camera every time, so that no manual change is missed.

    Parameters
    ----------
    session
        Session with the camera.
    clock
        Clock of the waiting for the camera.
    codes
        Codes of the properties that the camera reports.
    settle_s
        Seconds within which the camera must have taken a setting.
    """

    def __init__(
        self, session: Session, clock: Clock, codes: Collection[int], settle_s: float
    ) -> None:
        self._session = session
        self._clock = clock
        self._codes = codes
        self._settle_s = settle_s

    def describe(self, prop: StandardProperty) -> PropertyDescription | None:
        """Return the property's value now and its choices; None if the camera has no such property.

        Raises
        ------
        DeviceError
            The camera does not answer, or violates the protocol.
        """
        if prop not in self._codes:
            return None
        try:
            data = self._session.transact(Standard.GetDevicePropDesc, prop).data
        except RefusedError as refusal:
            if refusal.code not in _NOT_TOLD:
                raise
            return None
        return parse_property_description(data)

    def set(self, prop: StandardProperty, described: PropertyDescription, value: int) -> int:
        """Set a property unless it has the value already; return the value reported then.

        Raises
        ------
        DeviceError
            The camera refuses, or does not answer.
        """
        if described.value == value:
            return value
        self._session.transact(Standard.SetDevicePropValue, prop, data=described.encode(value))
        deadline_s = self._clock.now() + self._settle_s
        while (reported := self._ask(prop, described)) != value and self._clock.now() < deadline_s:
            self._clock.sleep(POLL_PERIOD_S)
        return reported

    def _ask(self, prop: StandardProperty, described: PropertyDescription) -> int:
        return described.decode(self._session.transact(Standard.GetDevicePropValue, prop).data)
