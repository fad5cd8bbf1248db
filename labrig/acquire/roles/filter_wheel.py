"""Filter wheels, which put one of their filters before the lamp, or before the camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol, runtime_checkable

from labrig.acquire.roles.role import (
    Device,
    ExerciseContext,
    Exercised,
    Measured,
    PlannedDevice,
    Role,
)
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text
from labrig.foundation.yaml_file import did_you_mean


@runtime_checkable
class FilterWheel(Device, Protocol):
    """A wheel, or a slide, with filters and an open slot. Safe state: at rest.

    A filter that is in the wheel is put in place by it; all others, by hand.
    """

    def filters(self) -> tuple[str, ...]:
        """Return the names of the filters in the wheel."""

    def put(self, name: str | None, /) -> None:
        """Turn to a filter, or to the open slot for None; return when it is in place.

        Raises
        ------
        DeviceError
            The wheel does not confirm that it is there.
        """


class PlannedFilterWheel(PlannedDevice):
    """Stand-in of a filter wheel in a plan, for which every turn takes the longest time."""

    def __init__(self, clock: VirtualClock, filters: Sequence[str], turn_s: float) -> None:
        self._clock = clock
        self._filters = tuple(filters)
        self._turn_s = turn_s
        self._name: str | None = None

    def filters(self) -> tuple[str, ...]:
        """Return the filters that the driver declares."""
        return self._filters

    def put(self, name: str | None, /) -> None:
        """Let the time of a turn pass, unless the filter is in place."""
        if name != self._name:
            self._clock.spend(self._turn_s)
        self._name = name


@dataclass(frozen=True)
class TurnWheel:
    """The action that turns the wheel before the lamp to a filter, or to its open slot for None."""

    filter: str | None
    device: ClassVar[str] = "filter_wheel"
    before: ClassVar[str] = "lamp"

    def __str__(self) -> str:
        return f"filter {self.filter}" if self.filter else "no filter"

    def begin(self, wheel: FilterWheel) -> None:
        """Turn the wheel, and wait until the filter is in place.

        Raises
        ------
        ProtocolError
            The wheel has no such filter.
        """
        if self.filter is not None and self.filter not in wheel.filters():
            raise ProtocolError(
                f"the protocol puts the filter '{self.filter}' before the {self.before}, which the "
                f"wheel has not; {did_you_mean(self.filter, wheel.filters())}"
            )
        wheel.put(self.filter)


@dataclass(frozen=True)
class TurnCameraWheel(TurnWheel):
    """The action that turns the wheel before the camera."""

    device: ClassVar[str] = "camera_filter_wheel"
    before: ClassVar[str] = "camera"


def _exercise(wheel: FilterWheel, context: ExerciseContext) -> Exercised:
    """Turn to every filter once, and back to the open slot."""
    measured = [
        Measured(f"to {name}", duration_text(context.timed_s(partial(wheel.put, name))))
        for name in wheel.filters()
    ]
    back_s = context.timed_s(partial(wheel.put, None))
    return Exercised((*measured, Measured("to the open slot", duration_text(back_s))))


def _role(key: str, name: str) -> Role[FilterWheel]:
    return Role(
        key=key,
        protocol_class=FilterWheel,
        name=name,
        planned=lambda driver, settings, clock: PlannedFilterWheel(
            clock, driver.declared_filters(settings), driver.declared_turn_s(settings)
        ),
        exercise=_exercise,
    )


FILTER_WHEEL = _role(TurnWheel.device, "filter wheel")
CAMERA_FILTER_WHEEL = _role(TurnCameraWheel.device, "filter wheel before the camera")
