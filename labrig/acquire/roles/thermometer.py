"""The thermometer, which measures the temperature of the sample or the room."""

from contextlib import suppress
from typing import Any, Protocol, runtime_checkable

from labrig.acquire.channels import TemperatureSensor
from labrig.acquire.connections import Connections
from labrig.acquire.roles.board_device import BoardDevice
from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role
from labrig.foundation.errors import DeviceError, DeviceLostError


@runtime_checkable
class Thermometer(Device, Protocol):
    """A thermometer at the sample or in the room. It has no unsafe state, and may be missing."""

    def celsius(self) -> float:
        """Return the temperature in degrees Celsius; takes seconds at most, even when it fails."""


class BoardThermometer(BoardDevice):
    """A temperature sensor on a board."""

    kind = TemperatureSensor
    noun = "thermometer"

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._sensor: TemperatureSensor = self.channel_class(self.board, settings)

    def identity(self) -> str:
        """Return the board's identity, and the channel."""
        return f"{self.board.identity()}, {self._sensor.identity()}"

    def celsius(self) -> float:
        """Return the temperature in degrees Celsius.

        Raises
        ------
        DeviceError
            There is no plausible reading. The line is resynchronised: a lamp may be on it.
        """
        try:
            return self._sensor.celsius()
        except DeviceError:
            with suppress(DeviceError):
                self.board.resynchronise()
            raise

    def make_safe(self) -> None:
        """Resynchronise the line; no thermometer is unsafe, not even one that is gone."""
        with suppress(DeviceLostError):
            self.board.resynchronise()


def _exercise(thermometer: Thermometer, context: ExerciseContext) -> Exercised:
    """Read the temperature once."""
    start_s = context.clock.now()
    celsius = thermometer.celsius()
    return Exercised(
        (
            Measured("temperature", f"{celsius:.1f} °C"),
            Measured("until it was read", f"{(context.clock.now() - start_s) * 1e3:.0f} ms"),
        )
    )


THERMOMETER: Role[Thermometer] = Role(
    key="thermometer",
    protocol_class=Thermometer,
    name="thermometer",
    on_board=BoardThermometer,
    exercise=_exercise,
)
