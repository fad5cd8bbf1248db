"""The lamp, the light that charges the sample."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from labrig.acquire.channels import Switch
from labrig.acquire.connections import Connections
from labrig.acquire.roles.board_device import BoardDevice, read_back_findings
from labrig.acquire.roles.role import (
    DARK,
    ExerciseContext,
    Exercised,
    Finding,
    Light,
    Measured,
    PlannedDevice,
    Role,
    spread_ms,
)
from labrig.foundation.errors import DeviceError

#: Number of switchings: enough to notice a slow line, too few to wear the relay.
SWITCHINGS = 3


@runtime_checkable
class Lamp(Light, Protocol):
    """A light that charges the sample. Safe state: off."""

    def on(self) -> None:
        """Switch the lamp on, read back where the device can."""

    def off(self) -> None:
        """Switch the lamp off, read back where the device can."""

    def is_on(self) -> bool:
        """Whether the lamp is on: as read back where the device can, else as commanded last."""


class PlannedLamp(PlannedDevice):
    """Stand-in of a lamp in a plan."""

    def __init__(self) -> None:
        self._on = False

    def reads_back(self) -> bool:
        """Return False: nothing else can switch a stand-in."""
        return False

    def on(self) -> None:
        """Switch the lamp on."""
        self._on = True

    def off(self) -> None:
        """Switch the lamp off."""
        self._on = False

    def is_on(self) -> bool:
        """Whether the lamp is on, as commanded last."""
        return self._on


class SwitchedLamp(BoardDevice):
    """A lamp on one switch of a board."""

    kind = Switch
    noun = "lamp"

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._switch: Switch = self.channel_class(self.board, settings)

    def identity(self) -> str:
        """Return the board's identity, and the switch."""
        return ", ".join(filter(None, (self.board.identity(), self._switch.identity())))

    def reads_back(self) -> bool:
        """Return whether the board reports the switch's state."""
        return self._switch.reads_back()

    def findings(self) -> Sequence[Finding]:
        """Return whether anything but the camera can verify that the lamp was switched."""
        return read_back_findings([self._switch])

    def on(self) -> None:
        """Switch the lamp on, and read it back where the board can."""
        self._switch.switch(on=True)

    def off(self) -> None:
        """Switch the lamp off, and read it back where the board can."""
        self._switch.switch(on=False)

    def is_on(self) -> bool:
        """Return the state that the board reports, else the one commanded last."""
        return self._switch.is_on()

    def make_safe(self) -> None:
        """Switch the lamp off, whatever was interrupted."""
        self.board.make_safe([self._switch])


@dataclass(frozen=True)
class LampSwitch:
    """The action that switches the lamp on or off."""

    on: bool
    device: ClassVar[str] = "lamp"

    def __str__(self) -> str:
        return "on" if self.on else DARK

    def begin(self, lamp: Lamp) -> None:
        """Switch the lamp."""
        if self.on:
            lamp.on()
        else:
            lamp.off()


LAMP_ON = LampSwitch(on=True)
LAMP_OFF = LampSwitch(on=False)


def _exercise(lamp: Lamp, context: ExerciseContext) -> Exercised:
    """Switch the lamp on for some hundredths of a second, `SWITCHINGS` times."""
    on_s, off_s = [], []
    try:
        for _ in range(SWITCHINGS):
            on_s.append(context.timed_s(lamp.on))
            _require_state(lamp, on=True)
            off_s.append(context.timed_s(lamp.off))
            _require_state(lamp, on=False)
    finally:
        with context.clock.shielded():
            lamp.off()
    return Exercised(
        (
            Measured("switch on, read back", spread_ms(on_s)),
            Measured("switch off, read back", spread_ms(off_s)),
        )
    )


def _require_state(lamp: Lamp, *, on: bool) -> None:
    if lamp.is_on() != on:
        state = "on" if on else "off"
        raise DeviceError(
            f"the lamp was switched {state}, it says otherwise; look at it, switch it off by hand "
            "and check the relay"
        )


LAMP: Role[Lamp] = Role(
    key="lamp",
    protocol_class=Lamp,
    name="lamp",
    planned=lambda settings, clock: PlannedLamp(),
    on_board=SwitchedLamp,
    exercise=_exercise,
    state=lambda lamp: str(LAMP_ON if lamp.is_on() else LAMP_OFF),
    safe_first=True,
)
