"""The sample changer, which brings one of several samples into the light."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol, runtime_checkable

from labrig.acquire.roles.role import (
    Device,
    ExerciseContext,
    Exercised,
    Finding,
    Measured,
    PlannedDevice,
    Role,
)
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text
from labrig.foundation.yaml_file import did_you_mean


@runtime_checkable
class SampleChanger(Device, Protocol):
    """A disk or a slide with samples. Safe state: all of them in the dark."""

    def samples(self) -> tuple[str, ...]:
        """Return the names of the samples on it."""

    def keeps_dark(self) -> bool:
        """Whether samples that are not in place lie in the dark while another one is lit."""

    def put(self, name: str | None, /) -> None:
        """Bring a sample into place, or all of them into the dark for None; return when done.

        Raises
        ------
        DeviceError
            The changer does not confirm it.
        """


class PlannedSampleChanger(PlannedDevice):
    """Stand-in of a sample changer in a plan, for which every turn takes the longest time."""

    def __init__(
        self, clock: VirtualClock, samples: Sequence[str], turn_s: float, *, keeps_dark: bool
    ) -> None:
        self._clock = clock
        self._samples = tuple(samples)
        self._turn_s = turn_s
        self._keeps_dark = keeps_dark
        self._name: str | None = None

    def samples(self) -> tuple[str, ...]:
        """Return the samples that the driver declares."""
        return self._samples

    def keeps_dark(self) -> bool:
        """Whether the rig file says that samples that are not in place lie in the dark."""
        return self._keeps_dark

    def put(self, name: str | None, /) -> None:
        """Let the time of a turn pass, unless the sample is in place."""
        if name != self._name:
            self._clock.spend(self._turn_s)
        self._name = name


@dataclass(frozen=True)
class BringSample:
    """The action that brings a sample into place, or all of them into the dark for None."""

    sample: str | None
    device: ClassVar[str] = "sample_changer"

    def __str__(self) -> str:
        return "all samples into the dark" if self.sample is None else f"sample {self.sample}"

    def begin(self, changer: SampleChanger) -> None:
        """Turn the changer, and wait until the sample is in place.

        Raises
        ------
        ProtocolError
            The changer has no such sample.
        """
        if self.sample is not None and self.sample not in changer.samples():
            raise ProtocolError(
                f"the protocol measures the sample '{self.sample}', which the sample changer has "
                f"not; {did_you_mean(self.sample, changer.samples())}"
            )
        changer.put(self.sample)


def _exercise(changer: SampleChanger, context: ExerciseContext) -> Exercised:
    """Bring every sample into place once, and all into the dark."""
    measured = [
        Measured(f"to {name}", duration_text(context.timed_s(partial(changer.put, name))))
        for name in changer.samples()
    ]
    away_s = context.timed_s(partial(changer.put, None))
    finding = (
        Finding("fine", "samples rest in the dark while another one is lit (keeps_dark)")
        if changer.keeps_dark()
        else Finding(
            "fine",
            "samples do not share their rests: nothing says that they lie in the dark while "
            "another one is lit",
            "if they do, write 'keeps_dark: true'",
        )
    )
    return Exercised((*measured, Measured("into the dark", duration_text(away_s))), (finding,))


SAMPLE_CHANGER: Role[SampleChanger] = Role(
    key=BringSample.device,
    protocol_class=SampleChanger,
    name="sample changer",
    planned=lambda driver, settings, clock: PlannedSampleChanger(
        clock,
        driver.declared_samples(settings),
        driver.declared_turn_s(settings),
        keeps_dark=driver.declared_keeps_dark(settings),
    ),
    exercise=_exercise,
)
