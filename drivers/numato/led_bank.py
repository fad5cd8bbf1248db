"""LEDs behind relays of a Numato board, one lit at a time; every relay is read back."""

from contextlib import suppress
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig.acquire import Connections
from labrig.errors import DeviceError

from .board import CHANNELS, Board

Name = Annotated[str, Field(min_length=1)]
Relay = Annotated[int, Field(ge=0, lt=len(CHANNELS))]


class NumatoLedBank:
    """Several relays of one Numato board, each switching an LED.

    Two LEDs are never lit together: all that may be lit are switched off and read back before
    another one is switched on.

    Parameters
    ----------
    address
        Serial port of the board; its other relays may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(BaseModel):
        """Keys of LEDs on relays of a Numato board in a rig file.

        Attributes
        ----------
        relays
            Relay of each LED by the LED's name, counted from 0, for example
            `{"450 nm": 1, "525 nm": 2}`.
        """

        model_config = ConfigDict(frozen=True, extra="forbid")

        relays: dict[Name, Relay] = Field(min_length=1)

        @model_validator(mode="after")
        def _a_relay_each(self) -> Self:
            if len(set(self.relays.values())) < len(self.relays):
                raise ValueError("expected a relay of its own for each LED in 'relays'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relays = settings.relays
        self._board = Board(address, connections)
        #: LEDs not read back as off since they were last lit; after connecting, all.
        self._may_be_lit = set(self._relays)

    @classmethod
    def declared_channels(cls, settings: Settings) -> tuple[str, ...]:
        """Return the names of the LEDs, for plans."""
        return tuple(settings.relays)

    def channels(self) -> tuple[str, ...]:
        """Return the names of the LEDs, in the rig file's order."""
        return tuple(self._relays)

    def reads_back(self) -> bool:
        """Return True: every Numato board reports the states of its relays."""
        return True

    def identity(self) -> str:
        """Return maker, firmware version and id of the board, and the names of the LEDs."""
        leds = ", ".join(f"{name} on relay {relay}" for name, relay in self._relays.items())
        return f"Numato relay board, {self._board.identity()}, LEDs {leds}"

    def light(self, channel: str) -> None:
        """Switch off all LEDs that may be lit, then switch on one; all are read back."""
        self.dark()
        self._may_be_lit.add(channel)
        self._board.switch(self._relays[channel], on=True)

    def dark(self) -> None:
        """Switch off all LEDs that may be lit, each even if another one fails; read all back."""
        failure: DeviceError | None = None
        for channel in [name for name in self._relays if name in self._may_be_lit]:
            try:
                self._board.switch(self._relays[channel], on=False)
                self._may_be_lit.remove(channel)
            except DeviceError as error:
                failure = failure or error
                with suppress(DeviceError):  # so that the next one is understood
                    self._board.resynchronise()
        if failure:
            raise failure

    def channel_on(self) -> str | None:
        """Return the name of the LED that the board reads as on.

        Raises
        ------
        DeviceError
            Several LEDs are on.
        """
        names = [name for name, relay in self._relays.items() if self._board.is_on(relay)]
        if len(names) > 1:
            raise DeviceError(
                f"{self._board.name}: {' and '.join(names)} are lit at once; something else has "
                "switched them: leave the board to labrig while it measures"
            )
        return names[0] if names else None

    def make_safe(self) -> None:
        """Resynchronise the line, then switch all LEDs off, whatever their states before."""
        self._board.resynchronise()
        self._may_be_lit = set(self._relays)
        self.dark()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
