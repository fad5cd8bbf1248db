"""Filter wheels, which put one of their filters before the lamp, or before the camera."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.acquire.roles.places import BoardPlaces, Places, PlannedPlaces, timed
from labrig.acquire.roles.role import ExerciseContext, Exercised, Role
from labrig.foundation.errors import ProtocolError
from labrig.foundation.yaml_file import did_you_mean


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


@dataclass(frozen=True)
class TurnWheel:
    """The action that turns the wheel before the lamp to a filter, or to its open slot for None."""

    filter: str | None
    device: ClassVar[str] = "filter_wheel"
    before: ClassVar[str] = "lamp"

    def __str__(self) -> str:
        return f"filter {self.filter}" if self.filter else "no filter"

    def begin(self, wheel: Places) -> None:
        """Turn the wheel, and wait until the filter is in place.

        Raises
        ------
        ProtocolError
            The wheel has no such filter.
        """
        if self.filter is not None and self.filter not in wheel.names():
            raise ProtocolError(
                f"the protocol puts the filter '{self.filter}' before the {self.before}, which the "
                f"wheel has not; {did_you_mean(self.filter, wheel.names())}"
            )
        wheel.put(self.filter)


@dataclass(frozen=True)
class TurnCameraWheel(TurnWheel):
    """The action that turns the wheel before the camera."""

    device: ClassVar[str] = "camera_filter_wheel"
    before: ClassVar[str] = "camera"


def _exercise(wheel: Places, context: ExerciseContext) -> Exercised:
    """Turn to every filter once, and back to the open slot."""
    return Exercised(tuple(timed(wheel, context, "to the open slot")))


def _role(key: str, name: str) -> Role[Places]:
    return Role(
        key=key,
        protocol_class=Places,
        name=name,
        planned=lambda settings, clock: PlannedPlaces(clock, settings.filters, settings.travel),
        on_board=BoardFilterWheel,
        exercise=_exercise,
    )


FILTER_WHEEL = _role(TurnWheel.device, "filter wheel")
CAMERA_FILTER_WHEEL = _role(TurnCameraWheel.device, "filter wheel before the camera")
