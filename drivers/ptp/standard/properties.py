"""Properties of a camera without a maker's extension: asking, setting, reading back."""

from collections.abc import Collection

from labrig.foundation.clock import Clock

from ..codes import (
    ACCESS_DENIED,
    OPERATION_NOT_SUPPORTED,
    PROPERTY_NOT_SUPPORTED,
    Standard,
    StandardProperty,
)
from ..failures import RefusedError
from ..session import Session
from .property_description import PropertyDescription, parse_property_description

POLL_PERIOD_S = 0.05
_NOT_TOLD = (OPERATION_NOT_SUPPORTED, PROPERTY_NOT_SUPPORTED, ACCESS_DENIED)


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
