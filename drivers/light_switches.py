"""LEDs or lamps behind relays of one board, one lit at a time."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Annotated, Protocol

from pydantic import Field

from labrig.acquire import LedLight
from labrig.foundation.errors import DeviceError

#: Name of a light in a rig file.
Name = Annotated[str, Field(min_length=1)]


class Switch(Protocol):
    """One relay, read back after each switching where its board can."""

    def switch(self, *, on: bool) -> None:
        """Switch the relay."""

    def is_on(self) -> bool:
        """Return the state of the relay."""


class LightSwitches:
    """Relays that each switch a light.

    Two lights are never lit together: all that may be lit are switched off and read back before
    another one is switched on.

    Parameters
    ----------
    board
        Name of the board in messages.
    switches
        Relay of each light by the light's name.
    lights
        What the rig file says of each light, by its name.
    resynchronise
        Function after which the board understands the next command, whatever was interrupted.
    """

    def __init__(
        self,
        board: str,
        switches: Mapping[str, Switch],
        lights: Mapping[str, LedLight],
        resynchronise: Callable[[], None],
    ) -> None:
        self._board_name = board
        self._switches = dict(switches)
        self._lights = dict(lights)
        self._resynchronise = resynchronise
        #: Lights not read back as off since they were last lit; after connecting, all.
        self._may_be_lit = set(self._switches)

    def channels(self) -> tuple[str, ...]:
        """Return the names of the lights, in the rig file's order."""
        return tuple(self._switches)

    def settling_s(self, name: str, /) -> float:
        """Return the time in seconds from switching a light on until it is steady."""
        return self._lights[name].settling

    def light(self, name: str, /) -> None:
        """Switch off all lights that may be lit, then switch on one; read back where possible."""
        self.dark()
        self._may_be_lit.add(name)
        self._switches[name].switch(on=True)

    def dark(self) -> None:
        """Switch off all lights that may be lit, each even if another one fails."""
        failure: DeviceError | None = None
        for lit in [name for name in self._switches if name in self._may_be_lit]:
            try:
                self._switches[lit].switch(on=False)
                self._may_be_lit.remove(lit)
            except DeviceError as error:
                failure = failure or error
                with suppress(DeviceError):  # so that the next one is understood
                    self._resynchronise()
        if failure:
            raise failure

    def channel_on(self) -> str | None:
        """Return the light that is on, as reported by the board, else as commanded last.

        Raises
        ------
        DeviceError
            Several lights are on.
        """
        names = [name for name, switch in self._switches.items() if switch.is_on()]
        if len(names) > 1:
            raise DeviceError(
                f"{self._board_name}: {' and '.join(names)} are lit at once; something else has "
                "switched them: leave the board to labrig while it measures"
            )
        return names[0] if names else None

    def make_safe(self) -> None:
        """Resynchronise the line, then switch all lights off, whatever their states before."""
        self._resynchronise()
        self._may_be_lit = set(self._switches)
        self.dark()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
