"""What goes wrong in a simulated room, and when: `simulation.faults` of a rig file."""

import math
from collections.abc import Iterable
from typing import Annotated, Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_serializer, model_validator

from labrig.quantity import DurationS, Fraction


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class FaultTime(_Part):
    """When a fault is there.

    Attributes
    ----------
    at
        From then on, in seconds after the epoch that the rig file gives. The room of a resumed
        run opens later than that, so that what was over stays over.
    lasting
        For so long; in YAML `for`. None: for ever.
    """

    at: DurationS = 0.0
    lasting: DurationS | None = Field(None, alias="for")

    @property
    def until(self) -> float:
        """When it is over."""
        return math.inf if self.lasting is None else self.at + self.lasting

    def is_on(self, now_s: float) -> bool:
        """Whether the fault is there at `now_s`."""
        return self.at <= now_s < self.until

    def seen_from(self, opening_s: float) -> Self:
        """The same on the clock of a room that opens `opening_s` after the rig file's epoch."""
        return self.model_copy(update={"at": self.at - opening_s})


class AfterBytes(FaultTime):
    """A fault that may also come when `after_bytes` have passed since the room was opened."""

    after_bytes: Annotated[int, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _one_beginning(self) -> Self:
        if self.after_bytes is not None and "at" in self.model_fields_set:
            raise ValueError("expected 'at' or 'after_bytes', got both")
        return self


class Slowness(FaultTime):
    """`takes`: seconds for each write, or for the whole way of a door."""

    takes: DurationS = 2.0


class Nap(FaultTime):
    """`for`: how long the PC sleeps, an hour if that is not said."""

    lasting: DurationS = Field(3600.0, alias="for")


class Step(FaultTime):
    """`by`: how far a clock is stepped."""

    by: DurationS = 3600.0


class Leak(FaultTime):
    """`level`: light from the surroundings, of the warm lamp's at the sample."""

    level: Annotated[Fraction, Field(ge=0, le=0.1)] = 1e-5


class Skipped(FaultTime):
    """`name`: of the filter; none: whichever."""

    name: str | None = None


WhenT = TypeVar("WhenT", bound=FaultTime)


def _or_its_name(schema: dict[str, Any]) -> None:
    """For editors: a fault that is always there may be written as its name alone."""
    when = {**schema, "minProperties": 1, "maxProperties": 1}
    schema.clear()
    schema["anyOf"] = [{"enum": list(when["properties"])}, when]


class Fault(_Part):
    """One item of `simulation.faults`: a name, or a name and when.

    Attributes
    ----------
    lamp_dead
        The lamp's relay switches, but nothing lights up: its bulb has blown, or makes bad contact.
    relay_dead
        The board acknowledges and its register reads on, but the contact does not close.
    relay_welded
        The contact that is closed, or closes, stays closed, whatever the register reads.
    relays_unplugged
        The relay board's cable is pulled, and put back. It has its own power: the contacts stay.
    relays_silent
        The board hears nothing and says nothing.
    relays_echo_lost
        The board obeys, but its echo is lost on the way.
    door_stuck
        The trap door stays where it is, whatever its servo is told; then it swings on.
    door_slow
        The trap door, or its servo, is slow to move.
    camera_unplugged
        The camera's cable is pulled, and put back.
    camera_busy
        The camera answers DeviceBusy to every full press.
    camera_full
        The camera believes that there is no room for a photograph, on the PC or on its card.
    mercury_dead
        The mercury lamp has current, but no arc.
    ambient_light
        Light leaks into the room, of `level` times the warm lamp's at the sample.
    lvf_turned
        The changer puts the LVF in the wrong way round.
    filter_skipped
        The changer reports a change of filter, but leaves the one before in.
    light_left_on
        Somebody has left the room's light on.
    thermometer_off
        The thermometer's wire has come off its input.
    disk_full
        No byte more fits on the disk with the run; with `after_bytes`, in the middle of a write.
    disk_slow
        The disk takes its time for everything that is written durably.
    clock_ahead, clock_back
        The PC's own clock is stepped, by hand, by a time server or for the summer. A program that
        is running keeps its own time; the next one starts with the new one.
    pc_asleep
        The PC falls asleep and wakes up again: to save energy, or because its lid was closed.
    """

    model_config = ConfigDict(json_schema_extra=_or_its_name)

    lamp_dead: FaultTime | None = None
    relay_dead: FaultTime | None = None
    relay_welded: FaultTime | None = None
    relays_unplugged: FaultTime | None = None
    relays_silent: FaultTime | None = None
    relays_echo_lost: FaultTime | None = None
    door_stuck: FaultTime | None = None
    door_slow: Slowness | None = None
    camera_unplugged: AfterBytes | None = None
    camera_busy: FaultTime | None = None
    camera_full: FaultTime | None = None
    mercury_dead: FaultTime | None = None
    ambient_light: Leak | None = None
    lvf_turned: FaultTime | None = None
    filter_skipped: Skipped | None = None
    light_left_on: FaultTime | None = None
    thermometer_off: FaultTime | None = None
    disk_full: AfterBytes | None = None
    disk_slow: Slowness | None = None
    clock_ahead: Step | None = None
    clock_back: Step | None = None
    pc_asleep: Nap | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_name(cls, item: Any) -> Any:
        if isinstance(item, str):
            return {item: {}}
        if isinstance(item, dict):
            if len(item) != 1:
                raise ValueError(f"expected one fault in each item of the list, got {len(item)}")
            return {name: {} if when is None else when for name, when in item.items()}
        return item

    @model_serializer
    def _to_name(self) -> dict[str, Any]:
        return {
            name: when.model_dump(mode="json", by_alias=True, exclude_unset=True)
            for name, when in self
            if when is not None
        }

    def seen_from(self, opening_s: float) -> Self:
        """The same on the clock of a room that opens `opening_s` after the rig file's epoch."""
        later = {name: when.seen_from(opening_s) for name, when in self if when is not None}
        return self.model_copy(update=later)


def given(whens: Iterable[WhenT | None]) -> tuple[WhenT, ...]:
    """Those that are there at all."""
    return tuple(when for when in whens if when is not None)
