"""When the lamp shone on the sample, and which charge every photograph of the glow belongs to."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from labrig.analyse.frames import left_out_lines
from labrig.analyse.overrides import Overrides
from labrig.calibration import BlankFile
from labrig.errors import DataError
from labrig.protocols.excitation import ExcitationFrames, UnitKind
from labrig.record import Attempt, FrameRecord, FrameRole, RunRecord

#: Frames that show the glow after a charge; those of a metering are exposed too long or too short.
GLOWING = (*ExcitationFrames, FrameRole.REST)


@dataclass(frozen=True)
class ChargeInterval:
    """When a unit charged, in seconds since 1970.

    Attributes
    ----------
    unit
        Its name.
    on_s, off_s
        When the lamp was switched.
    cold
        Part of what a cold lamp lacks that it lacked in this charge on average, 0 to 1.
    """

    unit: str
    on_s: float
    off_s: float
    cold_deficit: float = 0.0

    @property
    def is_direct(self) -> bool:
        """Whether it charged by the lamp itself."""
        return UnitKind.DIRECT.has(self.unit)


@dataclass(frozen=True)
class ChargeFrames:
    """The charges, by time, and the photographs after them.

    Attributes
    ----------
    intervals
        The charges.
    charge_of
        Photographs by time, each with the charge that it belongs to.
    left_out
        What to say of photographs that begin before the bench is dark.
    """

    intervals: Sequence[ChargeInterval]
    charge_of: Mapping[FrameRecord, ChargeInterval]
    left_out: tuple[str, ...] = ()

    @property
    def zero_s(self) -> float:
        """When the first charge began; from there times count."""
        return self.intervals[0].on_s

    def after(self, one: ChargeInterval) -> list[FrameRecord]:
        """The photographs of one charge."""
        return [frame for frame, charge in self.charge_of.items() if charge is one]


def charge_frames(
    run: RunRecord, overrides: Overrides, time_constant_s: float, blank: BlankFile | None = None
) -> ChargeFrames:
    """What a run says; photographs that begin before the bench is dark, by its blank, left out.

    Parameters
    ----------
    time_constant_s
        Time constant with which the lamp's housing warms and cools.

    Raises
    ------
    DataError
        There are no charges through the filter, or none without it, or no photographs; or the
        blank never became clean.
    """
    units = (_interval(attempt) for attempt in run.completed().values())
    lit = sorted((one for one in units if one is not None), key=lambda one: one.on_s)
    intervals = with_warmth(lit, time_constant_s)
    frames = [
        frame for role in GLOWING for frame in run.frames(role) if not overrides.excludes(frame)
    ]
    frames.sort(key=lambda frame: frame.start_time)
    of_frames = {frame: _interval_before(intervals, frame) for frame in frames}
    charge_of = {frame: one for frame, one in of_frames.items() if one is not None}
    left_out: tuple[str, ...] = ()
    if blank is not None and charge_of:
        charge_of, left_out = _cleaned(charge_of, blank)
    if not charge_of or len({one.is_direct for one in intervals}) < 2:
        raise DataError(
            f"{run.folder}: expected complete charges through the filter and without it; go on "
            f"with: labrig resume {run.folder}"
        )
    return ChargeFrames(intervals, charge_of, left_out)


def _cleaned(
    charge: Mapping[FrameRecord, ChargeInterval], blank: BlankFile
) -> tuple[dict[FrameRecord, ChargeInterval], tuple[str, ...]]:
    after_s = {frame: frame.start_time - one.off_s for frame, one in charge.items()}
    left_out = left_out_lines(list(after_s.values()), blank)
    return {frame: charge[frame] for frame, t in after_s.items() if blank.is_clean(t)}, left_out


def with_warmth(
    intervals: Sequence[ChargeInterval], time_constant_s: float
) -> list[ChargeInterval]:
    """By Newton's law: cold before the first charge, warmer in each one, cooler after it."""
    found: list[ChargeInterval] = []
    lacking, since_s = 1.0, 0.0
    for one in intervals:
        if found:
            lacking = 1 - (1 - lacking) * math.exp(-(one.on_s - since_s) / time_constant_s)
        charge_s = one.off_s - one.on_s
        mean = -math.expm1(-charge_s / time_constant_s) * time_constant_s / charge_s
        found.append(replace(one, cold_deficit=lacking * mean))
        lacking, since_s = lacking * math.exp(-charge_s / time_constant_s), one.off_s
    return found


def _interval(attempt: Attempt) -> ChargeInterval | None:
    times = {
        action.action: action.middle_time for action in attempt.actions if action.device == "lamp"
    }
    if not {"on", "off"} <= set(times):
        return None
    return ChargeInterval(attempt.unit, times["on"], times["off"])


def _interval_before(
    intervals: Sequence[ChargeInterval], frame: FrameRecord
) -> ChargeInterval | None:
    """The last one; None if there was none in the same arrangement of filter and lamp."""
    before = [one for one in intervals if one.off_s < frame.start_time]
    if not before or before[-1].is_direct is not UnitKind.DIRECT.has(frame.unit):
        return None
    return before[-1]
