"""The sample changer, which brings one of several samples into the light."""

from functools import partial
from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role
from labrig.quantity import duration_text


@runtime_checkable
class SampleChanger(Device, Protocol):
    """A disk or a slide with samples. Safe state: all of them in the dark."""

    def samples(self) -> tuple[str, ...]:
        """Return the names of the samples on it."""

    def put(self, name: str | None, /) -> None:
        """Bring a sample into place, or all of them into the dark for None; return when done.

        Raises
        ------
        DeviceError
            The changer does not confirm it.
        """


def _exercise(changer: SampleChanger, context: ExerciseContext) -> Exercised:
    """Bring every sample into place once, and all into the dark."""
    measured = [
        Measured(f"to {name}", duration_text(context.timed_s(partial(changer.put, name))))
        for name in changer.samples()
    ]
    away_s = context.timed_s(partial(changer.put, None))
    return Exercised((*measured, Measured("into the dark", duration_text(away_s))))


#: Without a stand-in: a sample is brought before the first unit, which takes seconds.
SAMPLE_CHANGER: Role[SampleChanger] = Role(
    key="sample_changer",
    protocol_class=SampleChanger,
    name="sample changer",
    exercise=_exercise,
)
