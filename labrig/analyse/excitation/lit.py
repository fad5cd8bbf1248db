"""When the lamp shone on the sample, and which charge every photograph of the glow belongs to."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from labrig.analyse.choices import Choices
from labrig.analyse.clean import left_out_lines
from labrig.calibration import BlankFile
from labrig.errors import DataError
from labrig.record import Attempt, FrameRecord, RunRecord

#: Frames that show the glow after a charge; those of a metering are exposed too long or too short.
GLOWING = ("strip", "bare", "rest")
#: Units that charged by the lamp itself; all others charged through the filter.
BARE = "bare-"


@dataclass(frozen=True)
class Lit:
    """A unit that charged.

    Attributes
    ----------
    cold
        Part of what a cold lamp lacks that it lacked in this charge on average, 0 to 1.
    """

    unit: str
    on_s: float
    off_s: float
    cold: float = 0.0

    @property
    def is_bare(self) -> bool:
        """Whether it charged by the lamp itself."""
        return self.unit.startswith(BARE)


@dataclass(frozen=True)
class Glowing:
    """The charges, by time, and the photographs after them.

    Attributes
    ----------
    charge
        Photographs by time, each with the charge that it belongs to.
    left_out
        What to say of photographs that begin before the bench is dark.
    """

    lit: Sequence[Lit]
    charge: Mapping[FrameRecord, Lit]
    left_out: tuple[str, ...] = ()

    @property
    def zero_s(self) -> float:
        """When the first charge began; from there times count."""
        return self.lit[0].on_s

    def after(self, one: Lit) -> list[FrameRecord]:
        """The photographs of one charge."""
        return [frame for frame, charge in self.charge.items() if charge is one]


def glowing(
    run: RunRecord, choices: Choices, warms_s: float, blank: BlankFile | None = None
) -> Glowing:
    """What a run says; photographs that begin before the bench is dark, by its blank, left out.

    Parameters
    ----------
    warms_s
        Time constant with which the lamp's housing warms and cools.

    Raises
    ------
    DataError
        There are no charges through the filter, or none without it, or no photographs; or the
        blank never became clean.
    """
    lit = with_warmth(
        sorted(
            (one for attempt in run.completed().values() for one in _lit(attempt)),
            key=lambda one: one.on_s,
        ),
        warms_s,
    )
    frames = [
        frame for purpose in GLOWING for frame in run.frames(purpose) if not choices.excludes(frame)
    ]
    frames.sort(key=lambda frame: frame.start_time)
    charge = {frame: one for frame in frames if (one := _charge_before(lit, frame)) is not None}
    charge, left_out = (charge, ()) if blank is None or not charge else _cleaned(charge, blank)
    if not charge or not any(one.is_bare for one in lit) or all(one.is_bare for one in lit):
        raise DataError(
            f"{run.folder}: expected complete charges through the filter and without it; go on "
            f"with: labrig resume {run.folder}"
        )
    return Glowing(lit, charge, left_out)


def _cleaned(
    charge: Mapping[FrameRecord, Lit], blank: BlankFile
) -> tuple[dict[FrameRecord, Lit], tuple[str, ...]]:
    after_s = {frame: frame.start_time - one.off_s for frame, one in charge.items()}
    left_out = left_out_lines(list(after_s.values()), blank)
    return {frame: charge[frame] for frame, t in after_s.items() if blank.is_clean(t)}, left_out


def with_warmth(lit: Sequence[Lit], warms_s: float) -> list[Lit]:
    """By Newton's law: cold before the first charge, warmer in each one, cooler after it."""
    found: list[Lit] = []
    lacking, since_s = 1.0, 0.0
    for one in lit:
        if found:
            lacking = 1 - (1 - lacking) * math.exp(-(one.on_s - since_s) / warms_s)
        charge_s = one.off_s - one.on_s
        mean = -math.expm1(-charge_s / warms_s) * warms_s / charge_s
        found.append(replace(one, cold=lacking * mean))
        lacking, since_s = lacking * math.exp(-charge_s / warms_s), one.off_s
    return found


def _lit(attempt: Attempt) -> Sequence[Lit]:
    times = {
        action.action: action.middle_time for action in attempt.actions if action.device == "lamp"
    }
    return [Lit(attempt.unit, times["on"], times["off"])] if {"on", "off"} <= set(times) else []


def _charge_before(lit: Sequence[Lit], frame: FrameRecord) -> Lit | None:
    """The last one; None if there was none in the same arrangement of filter and lamp."""
    before = [one for one in lit if one.off_s < frame.start_time]
    if not before or before[-1].is_bare is not frame.unit.startswith(BARE):
        return None
    return before[-1]
