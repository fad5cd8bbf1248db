"""Calibration of a bench, once for many samples: camera, lamp and variable filter in one run."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from labrig.acquire import Unit
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredUnit,
    Stage,
    in_turn,
)
from labrig.protocols.steps.chain import Chain

_CARD: Stage = "grey card"


class Calibration(Chain):
    """Settings of a bench's calibration; `calibration.yaml` is the commented example.

    All dark frames come first; then all that needs one configuration of the bench is photographed
    before the next one is asked for, with the lamp burning, and the mercury lamp comes last.
    """

    uses_calibrations = False

    protocol: Literal["calibration"] = "calibration"

    @property
    def sample_in_place(self) -> None:
        """No sample of a changer is in place: only the bench is measured."""
        return None

    def units(self) -> Sequence[Unit]:
        """Return the units of all parts, those with the same configuration together."""
        scenes = [scene for part in self.chain() for scene in part.configured_units()]
        lit = sorted((scene for scene in scenes if not scene.is_dark), key=_turn)
        first = lit[0] if lit else scenes[0]
        dark = (
            replace(scene, configuration=first.configuration, why=first.why)
            for scene in scenes
            if scene.is_dark
        )
        return in_turn([*dark, *lit])


def _turn(scene: ConfiguredUnit) -> tuple[bool, int, bool]:
    """Return the place of a scene in the order of the bench's configurations."""
    wanted = scene.configuration
    is_mercury = wanted.lamp == "mercury"
    halogen = (
        BenchConfiguration("blank"),
        BenchConfiguration(_CARD),
        BenchConfiguration(_CARD, "on sample"),
        BenchConfiguration(_CARD, "before camera"),
    )
    mercury = (
        BenchConfiguration(_CARD, "before camera"),
        BenchConfiguration(_CARD, "on sample"),
        BenchConfiguration("sample", "on sample"),
    )
    usual = replace(wanted, lamp="halogen", filter=None)
    order = mercury if is_mercury else halogen
    place = order.index(usual) if usual in order else len(order)
    return is_mercury, place, wanted.filter is not None
