"""The thermometer: how warm it is at the sample, or in the room."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role


@runtime_checkable
class Thermometer(Device, Protocol):
    """Tells how warm it is at the sample, or in the room. Safe: anything; one may be gone."""

    def celsius(self) -> float:
        """Temperature now, in degrees Celsius; takes seconds at most, even when it fails."""


def _exercise(thermometer: Thermometer, trial: ExerciseContext) -> Exercised:
    """Read it once."""
    asked_s = trial.clock.now()
    celsius = thermometer.celsius()
    return Exercised(
        (
            Measured("temperature", f"{celsius:.1f} °C"),
            Measured("until it was read", f"{(trial.clock.now() - asked_s) * 1e3:.0f} ms"),
        )
    )


THERMOMETER: Role[Thermometer] = Role(
    key="thermometer", does=Thermometer, name="thermometer", exercise=_exercise
)
