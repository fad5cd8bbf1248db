r"""Thorlabs FW102C and FW212C filter wheels: lines of text that the wheel echoes.

`pos?\r` is answered by the echo, `3\r` and the prompt `> `; a command by its echo and the prompt;
one that it does not understand by `Command error CMD_NOT_DEFINED`. Sources: Thorlabs' manual of the
FW102C and public drivers, those of Micro-Manager and of matusm (Bev.Instruments.Thorlabs.FW), where
half a turn took 2.9 s. Whether the prompt waits for the wheel they do not say, so that the position
is read until it is the one that was asked for.
"""

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field, model_validator

from labrig.acquire import Connections
from labrig.foundation.errors import DeviceError, UnclearAnswerError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from .named_places import FilterPlaces
from .serial_line import SerialLine

BAUDRATE = 115_200
PROMPT = b"> "
MODELS = ("FW102C", "FW212C")
MOST_SLOTS = 12
#: Pause between two readings of the position.
LOOK_AGAIN_S = 0.1


class ThorlabsFilterWheel(FilterPlaces[int]):
    """A filter wheel of Thorlabs on its USB serial port.

    Parameters
    ----------
    address
        Serial port of the wheel.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.

    Raises
    ------
    DeviceError
        Another device is at the address, or the wheel has fewer slots than the rig file names.
    """

    class Settings(FrozenModel):
        """Keys of a Thorlabs filter wheel in a rig file.

        Attributes
        ----------
        filters
            Slot of each filter, as printed on the wheel, by the filter's name, for example
            `{bandpass-450: 2, bandpass-500: 3}`.
        open_slot
            Slot without a filter.
        takes_at_most
            Time within which the wheel must have turned, for example `10 s`.
        """

        filters: Mapping[str, Annotated[int, Field(ge=1, le=MOST_SLOTS)]] = Field(min_length=1)
        open_slot: Annotated[int, Field(ge=1, le=MOST_SLOTS)] = 1
        takes_at_most: Annotated[DurationS, Field(gt=0, le=60)] = 10.0

        @model_validator(mode="after")
        def _one_filter_a_slot(self) -> Self:
            slots = [self.open_slot, *self.filters.values()]
            if len(set(slots)) < len(slots):
                raise ValueError(
                    "expected a slot of its own for every filter and for the open one, got "
                    f"{', '.join(map(str, sorted(slots)))}"
                )
            return self

    @classmethod
    def declared_turn_s(cls, settings: Settings) -> float:
        """Return the time within which the wheel must have turned, in seconds."""
        return settings.takes_at_most

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(settings.filters, settings.open_slot)
        self._settings = settings
        self._clock = connections.clock
        self._name = f"the filter wheel at {address}"
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, self._clock, self._name)
        self._resynchronise()
        self._model = self._ask("*idn?")
        if not any(model in self._model for model in MODELS):
            raise DeviceError(
                f"{self._name} was asked for its name: expected {' or '.join(MODELS)}, got "
                f"'{self._model}'; check the address"
            )
        slots, named = self._number("pcount?"), [*settings.filters.values(), settings.open_slot]
        if max(named) > slots:
            raise DeviceError(
                f"{self._name} has {slots} slots, the rig file names slot {max(named)}; correct "
                "'filters' or 'open_slot'"
            )

    def identity(self) -> str:
        """Return model and firmware of the wheel."""
        return " ".join(self._model.split())

    def _move(self, slot: int) -> None:
        """Turn to a slot; return when the wheel says that it is there.

        Raises
        ------
        UnclearAnswerError
            The wheel does not get there, or gives another answer.
        """
        if self._number("pos?") == slot:
            return
        if answer := self._ask(f"pos={slot}"):
            raise UnclearAnswerError(
                f"{self._name} was sent to slot {slot}: expected no answer, got '{answer}'"
            )
        deadline_s = self._clock.now() + self._settings.takes_at_most
        while (position := self._number("pos?")) != slot:
            if self._clock.now() >= deadline_s:
                raise UnclearAnswerError(
                    f"{self._name} was sent to slot {slot} and says that it is at {position}; look "
                    "whether it turns freely"
                )
            self._clock.sleep(LOOK_AGAIN_S)

    def make_safe(self) -> None:
        """End a half-written line and discard old answers; a turning wheel ends its turn."""
        self._resynchronise()
        self._number("pos?")

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""

    def _resynchronise(self) -> None:
        self._line.write(b"\r")
        self._line.drain()

    def _ask(self, command: str) -> str:
        """Send a command and return what stands between its echo and the prompt.

        Raises
        ------
        UnclearAnswerError
            The wheel does not understand, echoes something else or does not answer.
        """
        self._line.discard()
        self._line.write(command.encode() + b"\r")
        received = self._line.read_until(PROMPT, self._settings.takes_at_most)
        echo, *answer = received.removesuffix(PROMPT).decode("ascii", "replace").split("\r")
        text = " ".join(" ".join(answer).split())
        if echo.strip() != command or "error" in text.lower():
            raise UnclearAnswerError(
                f"{self._name} was sent '{command}': expected its echo and an answer, got "
                f"{received!r}"
            )
        return text

    def _number(self, query: str) -> int:
        answer = self._ask(query)
        if not answer.isdecimal():
            raise UnclearAnswerError(
                f"{self._name} was asked '{query}': expected a number, got '{answer}'"
            )
        return int(answer)
