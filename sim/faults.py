"""Faults of a simulated room and their times: `simulation.faults` of a rig file."""

import math
from collections.abc import Iterable
from typing import Annotated, Any, Self, TypeVar

from pydantic import ConfigDict, Field, model_serializer, model_validator

from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, Fraction


class FaultTime(FrozenModel):
    """Time span of a fault.

    Attributes
    ----------
    at
        Start of the fault after the epoch that the rig file gives, for example `25 min`. The room
        of a resumed run opens later than that epoch, so that a past fault stays past.
    lasting
        Duration of the fault, `for` in YAML, for example `20 s`; null: it lasts for ever.
    """

    at: DurationS = 0.0
    lasting: DurationS | None = Field(None, alias="for")

    @property
    def until(self) -> float:
        """End of the fault in seconds; infinity if it lasts for ever."""
        return math.inf if self.lasting is None else self.at + self.lasting

    def is_on(self, now_s: float) -> bool:
        """Return whether the fault is there at `now_s`."""
        return self.at <= now_s < self.until

    def seen_from(self, opening_s: float) -> Self:
        """Return the fault on the clock of a room that opens `opening_s` after its epoch."""
        return self.model_copy(update={"at": self.at - opening_s})


class AfterBytes(FaultTime):
    """A fault that may also come when `after_bytes` have passed since the room was opened.

    Attributes
    ----------
    after_bytes
        Number of bytes, since the room was opened, after which the fault begins; given instead of
        `at`.
    """

    after_bytes: Annotated[int, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _one_beginning(self) -> Self:
        if self.after_bytes is not None and "at" in self.model_fields_set:
            raise ValueError("expected 'at' or 'after_bytes', got both")
        return self


class Slowness(FaultTime):
    """A fault that slows something down.

    Attributes
    ----------
    takes
        Time that each write, or the whole way of a door, takes, for example `2 s`.
    """

    takes: DurationS = 2.0


class Nap(FaultTime):
    """A fault that puts the PC to sleep.

    Attributes
    ----------
    lasting
        Duration of the PC's sleep, `for` in YAML, for example `1 h`.
    """

    lasting: DurationS = Field(3600.0, alias="for")


class Step(FaultTime):
    """A fault that steps a clock.

    Attributes
    ----------
    by
        Time by which the clock is stepped, for example `1 h`.
    """

    by: DurationS = 3600.0


class Leak(FaultTime):
    """A fault that lets light in.

    Attributes
    ----------
    level
        Irradiance at the sample of light from the surroundings, as a fraction of the warm lamp's,
        for example `0.001 %`.
    """

    level: Annotated[Fraction, Field(ge=0, le=0.1)] = 1e-5


class Skipped(FaultTime):
    """A fault at a change of filter.

    Attributes
    ----------
    name
        Name of the filter to which the changer does not change; null: whichever.
    """

    name: str | None = None


class OfBoard(FaultTime):
    """A fault of one board.

    Attributes
    ----------
    board
        Board by the last part of its address, for example `servo` of `sim://room/servo`.
    """

    board: str


class OfLed(FaultTime):
    """A fault of one LED.

    Attributes
    ----------
    relay
        Relay or output of the LED, as under `leds`; null: each of them.
    """

    relay: Annotated[int, Field(ge=1, le=12)] | None = None


WhenT = TypeVar("WhenT", bound=FaultTime)


def _or_its_name(schema: dict[str, Any]) -> None:
    """Allow the name alone in the schema: the fault is then always there."""
    with_span = {**schema, "minProperties": 1, "maxProperties": 1}
    schema.clear()
    name = {
        "description": "Name of a fault that is there from the epoch on and for ever.",
        "enum": list(with_span["properties"]),
    }
    with_span["description"] = "Name of a fault and its time span."
    schema["anyOf"] = [name, with_span]


class Fault(FrozenModel):
    """One item of `simulation.faults`: a name, or a name and when.

    Attributes
    ----------
    lamp_dead
        The lamp's relay switches, but the lamp stays dark: its bulb has blown, or makes bad
        contact.
    relay_dead
        The relay board acknowledges and its register reads on, but the contact does not close.
    relay_welded
        The relay's contact that is closed, or closes, stays closed, whatever the register reads.
    relays_unplugged
        The relay board's cable is pulled, and plugged in again. The board has its own power, so
        that the contacts stay as they are.
    board_unplugged
        The cable of any board is pulled, and plugged in again. The board has its own power, so that
        whatever it holds stays as it is.
    relays_silent
        The relay board receives nothing and sends nothing.
    relays_echo_lost
        The relay board obeys, but its echo is lost on the way.
    door_stuck
        The trap door stays where it is, whatever its servo receives; after the fault it swings on.
    door_slow
        The trap door, or its servo, is slow to move.
    camera_unplugged
        The camera's cable is pulled, and plugged in again.
    camera_busy
        The camera answers DeviceBusy to every full press.
    camera_full
        The camera reports that there is no room for a photograph, on the PC or on its card.
    mercury_dead
        The mercury lamp has current, but no arc.
    led_dark
        The LED stays dark, whatever its relay or output reports: its wire has come off.
    led_stuck
        The LED, if it is lit or gets lit, stays lit, whatever its relay or output reports.
    ambient_light
        Light leaks into the room, of `level` times the warm lamp's at the sample.
    lvf_turned
        The changer puts the LVF in the wrong way round.
    filter_skipped
        The changer reports a change of filter, but leaves the one before in.
    light_left_on
        The room's light has been left on.
    thermometer_off
        The thermometer's wire has come off its input.
    spectrometer_unplugged
        The spectrometer's cable is pulled, and plugged in again.
    spectrometer_silent
        The spectrometer receives nothing and sends nothing.
    spectrometer_truncated
        The spectrometer's spectra end too early.
    disk_full
        The disk with the run has no room for another byte; with `after_bytes`, in the middle of a
        write.
    disk_slow
        The disk takes its time for everything that is written durably.
    clock_ahead
        The PC's own clock is stepped ahead, by hand, by a time server or for the summer. A program
        that is running keeps its own time, and may notice; the next one starts with the new one.
    clock_back
        The PC's own clock is stepped back. A program that is running keeps its own time, and may
        notice; the next one starts with the new one.
    pc_asleep
        The PC falls asleep and wakes up again: to save energy, or because its lid was closed.
    """

    model_config = ConfigDict(json_schema_extra=_or_its_name)

    lamp_dead: FaultTime | None = None
    relay_dead: FaultTime | None = None
    relay_welded: FaultTime | None = None
    relays_unplugged: FaultTime | None = None
    board_unplugged: OfBoard | None = None
    relays_silent: FaultTime | None = None
    relays_echo_lost: FaultTime | None = None
    door_stuck: FaultTime | None = None
    door_slow: Slowness | None = None
    camera_unplugged: AfterBytes | None = None
    camera_busy: FaultTime | None = None
    camera_full: FaultTime | None = None
    mercury_dead: FaultTime | None = None
    led_dark: OfLed | None = None
    led_stuck: OfLed | None = None
    ambient_light: Leak | None = None
    lvf_turned: FaultTime | None = None
    filter_skipped: Skipped | None = None
    light_left_on: FaultTime | None = None
    thermometer_off: FaultTime | None = None
    spectrometer_unplugged: FaultTime | None = None
    spectrometer_silent: FaultTime | None = None
    spectrometer_truncated: FaultTime | None = None
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
            return {name: {} if span is None else span for name, span in item.items()}
        return item

    @model_serializer
    def _to_name(self) -> dict[str, Any]:
        return {
            name: span.model_dump(mode="json", by_alias=True, exclude_unset=True)
            for name, span in self
            if span is not None
        }

    def seen_from(self, opening_s: float) -> Self:
        """Return the fault on the clock of a room that opens `opening_s` after its epoch."""
        later = {name: span.seen_from(opening_s) for name, span in self if span is not None}
        return self.model_copy(update=later)


def given(spans: Iterable[WhenT | None]) -> tuple[WhenT, ...]:
    """Return the time spans of the faults that are given."""
    return tuple(span for span in spans if span is not None)
