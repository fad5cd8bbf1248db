"""Samples of a changer that take turns: one rests in the dark while another is measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from labrig.acquire import Session, Unit

from .bench_configuration import BenchConfiguration, ConfiguredUnit


@dataclass(frozen=True)
class UnitOfSample:
    """A unit before which the changer brings its sample, or takes all away.

    Attributes
    ----------
    unit
        Unit of one sample.
    sample
        Name of the sample on the changer; None if all of them are to lie in the dark.
    """

    unit: Unit
    sample: str | None

    @property
    def name(self) -> str:
        """Name of the unit."""
        return self.unit.name

    def run(self, session: Session) -> None:
        """Bring the sample, then run the unit, whose rest counts the time on the changer."""
        session.bring(self.sample)
        self.unit.run(session)


@dataclass(frozen=True)
class SampleTurn:
    """A scene of one sample.

    Attributes
    ----------
    part
        Name of its part of the chain, the same for all samples.
    scene
        ConfiguredUnit of the sample.
    """

    part: str
    scene: ConfiguredUnit

    @property
    def group(self) -> tuple[str, BenchConfiguration, bool]:
        """Key of the scenes among which samples may take turns: one part, one configuration."""
        return self.part, self.scene.configuration, self.scene.is_dark


def in_sample_turns(
    scenes: Mapping[str, Sequence[SampleTurn]], *, shared: bool
) -> list[ConfiguredUnit]:
    """Return the scenes of all samples in the order of measurement.

    With shared rests the samples take turns, scene by scene, where scenes of one part in one
    configuration begin with a rest; where they do not, sample follows sample, so that a lamp that
    burns need not be switched off. An configuration of the bench is made once for all samples.

    Parameters
    ----------
    scenes
        Scenes of every sample by its name: the same parts for all of them, in the same order.
    shared
        Whether a sample may rest while another one is measured; else all of one sample comes
        before the next.

    Raises
    ------
    ValueError
        The samples do not have the same scenes.
    """
    own = {
        name: [_on_changer(name, each) for each in of_sample] for name, of_sample in scenes.items()
    }
    if not shared:
        return [each.scene for of_sample in own.values() for each in of_sample]
    ordered: list[SampleTurn] = []
    rounds = list(zip(*own.values(), strict=True))
    for _, alike in groupby(rounds, key=lambda each: each[0].group):
        of_group = list(alike)
        if any(first.scene.rests for first, *_ in of_group):
            ordered += [each for one_round in of_group for each in one_round]
        else:
            ordered += [each for of_sample in zip(*of_group, strict=True) for each in of_sample]
    return [each.scene for each in ordered]


def _on_changer(sample: str, each: SampleTurn) -> SampleTurn:
    """Return the scene with its sample brought before it, or all taken away from a card."""
    scene = each.scene
    in_place = sample if scene.configuration.stage in ("sample", "lit sample") else None
    return replace(each, scene=replace(scene, unit=UnitOfSample(scene.unit, in_place)))
