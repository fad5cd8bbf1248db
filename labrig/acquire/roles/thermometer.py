"""The thermometer, which measures the temperature of the sample or the room."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role


@runtime_checkable
class Thermometer(Device, Protocol):
    """A thermometer at the sample or in the room. It has no unsafe state, and may be missing."""

    def celsius(self) -> float:
        """Return the temperature in degrees Celsius; takes seconds at most, even when it fails."""


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
    key="thermometer", protocol_class=Thermometer, name="thermometer", exercise=_exercise
)
