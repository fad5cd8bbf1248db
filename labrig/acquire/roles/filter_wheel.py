"""Filter wheels, which put one of their filters before the lamp, or before the camera."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol, runtime_checkable

from labrig.acquire.roles.places import BoardPlaces, PlannedPlaces, timed
from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role
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


class PlannedFilterWheel(PlannedPlaces):
    """Stand-in of a filter wheel in a plan."""

    def filters(self) -> tuple[str, ...]:
        """Return the filters in the rig file."""
        return self._names


class BoardFilterWheel(BoardPlaces):
    """Filters on an arm, a slide or a wheel that a channel of a board moves."""

    noun = "filter wheel"
    things = (
        "filters",
        "Position with each filter in place, by the filter's name, for example "
        "`{bandpass-450: 1100 us, bandpass-500: 1300 us}` on a servo, "
        "`{bandpass-450: 2, bandpass-500: 3}` for the slots of a wheel.",
    )
    empty = ("open", "Position with no filter in place.")

    def filters(self) -> tuple[str, ...]:
        """Return the names of the filters in the wheel."""
        return tuple(self._positions)


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
    measured = timed(wheel, wheel.filters(), context)
    back_s = context.timed_s(partial(wheel.put, None))
    return Exercised((*measured, Measured("to the open slot", duration_text(back_s))))


def _role(key: str, name: str) -> Role[FilterWheel]:
    return Role(
        key=key,
        protocol_class=FilterWheel,
        name=name,
        planned=lambda settings, clock: PlannedFilterWheel(
            clock, settings.filters, settings.travel
        ),
        on_board=BoardFilterWheel,
        exercise=_exercise,
    )


FILTER_WHEEL = _role(TurnWheel.device, "filter wheel")
CAMERA_FILTER_WHEEL = _role(TurnCameraWheel.device, "filter wheel before the camera")
