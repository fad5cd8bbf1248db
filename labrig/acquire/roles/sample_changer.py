"""The sample changer, which brings one of several samples into the light."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from pydantic import Field

from labrig.acquire.roles.places import BoardPlaces, Places, PlannedPlaces, timed
from labrig.acquire.roles.role import ExerciseContext, Exercised, Finding, Role
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError
from labrig.foundation.yaml_file import did_you_mean


@runtime_checkable
class SampleChanger(Places, Protocol):
    """A disk or a slide with samples. Safe state: all of them in the dark, none in place."""

    def keeps_dark(self) -> bool:
        """True if samples that are not in place lie in the dark while another one is lit."""


class PlannedSampleChanger(PlannedPlaces):
    """Stand-in of a sample changer in a plan."""

    def __init__(
        self, clock: VirtualClock, samples: Sequence[str], travel_s: float, *, keeps_dark: bool
    ) -> None:
        super().__init__(clock, samples, travel_s)
        self._keeps_dark = keeps_dark

    def keeps_dark(self) -> bool:
        """Whether the rig file says that samples that are not in place lie in the dark."""
        return self._keeps_dark


class BoardSampleChanger(BoardPlaces):
    """Samples on a disk or a slide that a channel of a board moves."""

    noun = "sample changer"
    things = (
        "samples",
        "Position with each sample in place, by the sample's name, for example "
        "`{blue-paint: 1100 us, green-paint: 1300 us}` on a servo.",
    )
    empty = ("away", "Position with all samples in the dark.")
    role_keys: ClassVar[Mapping[str, Any]] = {
        "keeps_dark": (
            bool,
            Field(
                False,
                description="Whether samples that are not in place lie in the dark, light-tight, "
                "while another one is lit and photographed. Only then may one rest while another "
                "is measured.",
            ),
        )
    }

    def keeps_dark(self) -> bool:
        """True if samples that are not in place lie in the dark while another one is lit."""
        keeps_dark: bool = self.settings.keeps_dark
        return keeps_dark


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
        if self.sample is not None and self.sample not in changer.names():
            raise ProtocolError(
                f"the protocol measures the sample '{self.sample}', which the sample changer has "
                f"not; {did_you_mean(self.sample, changer.names())}"
            )
        changer.put(self.sample)


def _exercise(changer: SampleChanger, context: ExerciseContext) -> Exercised:
    """Bring every sample into place once, and all into the dark."""
    measured = timed(changer, context, "into the dark")
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
    return Exercised(tuple(measured), (finding,))


SAMPLE_CHANGER: Role[SampleChanger] = Role(
    key=BringSample.device,
    protocol_class=SampleChanger,
    name="sample changer",
    planned=lambda settings, clock: PlannedSampleChanger(
        clock, settings.samples, settings.travel, keeps_dark=settings.keeps_dark
    ),
    on_board=BoardSampleChanger,
    exercise=_exercise,
)
