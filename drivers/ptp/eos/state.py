"""State of an EOS, kept from its events; and setting its properties."""

from collections.abc import Collection
from contextlib import suppress

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..failures import RefusedError
from ..session import DEFAULT_TIMEOUTS, Session, Timeouts
from .custom_functions import CustomFunctions
from .events import ChoicesChanged, Event, ObjectOffered, ValueChanged, parse_events
from .protocol import Eos, Property, property_dataset, value_text

POLL_PERIOD_S = 0.03
#: Largest number of answers in a row; a camera lists its state in a few.
MAX_ANSWERS = 64
#: Largest number of frames, many times what fits into a camera's memory for the PC.
MAX_OFFERED = 1000
_KNOWN = frozenset(Property)


class EosState:
    """Mirror of the camera's properties and of the frames that it offers.

    The last report of a property is in doubt from a set that was not confirmed, or an answer that
    was lost, until the camera reports it again: it is then set anew.

    Parameters
    ----------
    session
        Session with the camera.
    clock
        Clock of the waiting for the camera.
    settle_s
        Seconds within which the camera must have taken a setting.
    operations
        Codes of the operations that the camera has.
    """

    def __init__(
        self, session: Session, clock: Clock, settle_s: float, operations: Collection[int]
    ) -> None:
        self._session = session
        self._clock = clock
        self._settle_s = settle_s
        self._can_be_asked = Eos.RequestDevicePropValue in operations
        self._values: dict[int, bytes] = {}
        self._in_doubt: set[int] = set()
        self._choices: dict[int, tuple[int, ...]] = {}
        self._offered: dict[int, ObjectOffered] = {}
        self.custom_functions = CustomFunctions()

    @property
    def offered(self) -> tuple[ObjectOffered, ...]:
        """Frames that wait in the camera, oldest first."""
        return tuple(self._offered.values())

    def value(self, prop: Property) -> int | None:
        """Return a numeric property, None if the camera never reported it."""
        value = self._values.get(prop)
        return int.from_bytes(value[:4], "little") if value else None

    def choices(self, prop: Property) -> tuple[int, ...]:
        """Return the codes that a property can be set to, as the camera lists them."""
        return self._choices.get(prop, ())

    def refresh(self, busy_s: float = DEFAULT_TIMEOUTS.busy_s) -> None:
        """Take in all events that wait in the camera, which may be busy for `busy_s` seconds.

        Raises
        ------
        DeviceError
            The camera does not answer, violates the protocol, or never comes to an end.
        """
        for _ in range(MAX_ANSWERS):
            if not self.listen(busy_s):
                return
        raise DeviceError(
            f"expected the camera to come to an end, it has reported events {MAX_ANSWERS} times "
            "in a row: switch it off and on"
        )

    def listen(self, busy_s: float = DEFAULT_TIMEOUTS.busy_s) -> bool:
        """Ask once for events; return whether there were any. The camera may be busy for `busy_s`.

        Raises
        ------
        DeviceError
            The camera does not answer, or violates the protocol.
        """
        events = self._events(Timeouts(DEFAULT_TIMEOUTS.answer_s, busy_s))
        for event in events:
            match event:
                case ValueChanged(prop, value) if prop in _KNOWN:
                    self._values[prop] = value
                    self._in_doubt.discard(prop)
                    if prop == Property.custom_functions:
                        self.custom_functions.take(value)
                case ChoicesChanged(prop, codes) if prop in _KNOWN:
                    self._choices[prop] = codes
                case ObjectOffered():
                    self._offered.setdefault(event.handle, event)
        if (many := len(self._offered)) > MAX_OFFERED:
            self._offered.clear()
            raise DeviceError(
                f"expected at most {MAX_OFFERED} frames in the camera, it offers {many}: switch "
                "it off and on"
            )
        return bool(events)

    def forget(self, offered: ObjectOffered) -> None:
        """Note that a frame no longer waits in the camera."""
        del self._offered[offered.handle]

    def set(self, prop: Property, value: bytes) -> None:
        """Set a property unless it has the value already, and wait for the camera's confirmation.

        Raises
        ------
        DeviceError
            The camera refuses, or still reports another value at the end of the settling time.
        """
        if self._has(prop, value):
            return
        self._in_doubt.add(prop)
        self._session.transact(Eos.SetDevicePropValueEx, data=property_dataset(prop, value))
        deadline_s = self._clock.now() + self._settle_s
        ask_s = self._clock.now() + self._settle_s / 2
        self.refresh()
        while not self._has(prop, value):
            if self._clock.now() >= deadline_s:
                if self._says(prop, value):
                    return  # it took it, and reports nothing that it had before
                reported = self._values.get(prop)
                raise DeviceError(
                    f"asked the camera for {prop.name.replace('_', ' ')} (0x{prop:X}) = "
                    f"{value_text(prop, value)}, it says "
                    f"{'nothing' if reported is None else value_text(prop, reported)}: "
                    "turn its dial to M, leave its menus, and try again"
                )
            self._clock.sleep(POLL_PERIOD_S)
            if self._can_be_asked and self._clock.now() >= ask_s:
                with suppress(RefusedError):
                    self._session.transact(Eos.RequestDevicePropValue, prop)
                ask_s = deadline_s
            self.refresh()

    def _events(self, timeouts: Timeouts) -> tuple[Event, ...]:
        try:
            return parse_events(self._session.transact(Eos.GetEvent, timeouts=timeouts).data)
        except RefusedError:
            raise
        except DeviceError:
            self._in_doubt.update(self._values)  # nobody knows what that answer said
            raise

    def _has(self, prop: Property, value: bytes) -> bool:
        return prop not in self._in_doubt and self._says(prop, value)

    def _says(self, prop: Property, value: bytes) -> bool:
        """Return whether the camera reports a value; models differ in the zeros after it."""
        reported = self._values.get(prop)
        return reported is not None and reported.rstrip(b"\0") == value.rstrip(b"\0")
