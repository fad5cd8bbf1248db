"""Intervals in which the lamp charged the sample, and the charge before every photograph."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from labrig.acquire import DARK, LAMP, LEDS
from labrig.analyse.frames import left_out_warnings
from labrig.analyse.overrides import Overrides
from labrig.calibration import BlankFile
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import ResultWarning
from labrig.protocols.excitation.protocol import ExcitationFrames, UnitKind
from labrig.record import Attempt, FrameRecord, FrameRole, RunRecord

#: Roles of frames of the glow after a charge; metering frames are exposed too long or too short.
GLOWING = (*ExcitationFrames, FrameRole.REST)


@dataclass(frozen=True)
class ChargeInterval:
    """Interval in which a unit charged, in seconds since 1970.

    Attributes
    ----------
    unit
        Name of the unit.
    on_s, off_s
        Times at which the lamp, or an LED, was switched on and off.
    is_led
        Whether an LED charged.
    cold_deficit
        Mean warm-up deficit during this charge as a fraction of a cold lamp's, 0 to 1.
    """

    unit: str
    on_s: float
    off_s: float
    is_led: bool = False
    cold_deficit: float = 0.0

    @property
    def is_direct(self) -> bool:
        """Whether the lamp charged directly, without the filter."""
        return UnitKind.DIRECT.has(self.unit)

    @property
    def light(self) -> str | None:
        """Name of the selected light; None of the variable filter and of the lamp itself."""
        return UnitKind.light_of(self.unit)


@dataclass(frozen=True)
class ChargeFrames:
    """Charges by time, and the photographs after them.

    Attributes
    ----------
    intervals
        The charges.
    charge_of
        Charge before each photograph, by time.
    left_out
        Warnings about photographs that begin before the bench is dark.
    """

    intervals: Sequence[ChargeInterval]
    charge_of: Mapping[FrameRecord, ChargeInterval]
    left_out: tuple[ResultWarning, ...] = ()

    @property
    def zero_s(self) -> float:
        """Start of the first charge in seconds since 1970, from which times count."""
        return self.intervals[0].on_s

    def after(self, interval: ChargeInterval) -> list[FrameRecord]:
        """Return the photographs after one charge."""
        return [frame for frame, charge in self.charge_of.items() if charge is interval]


def charge_frames(
    run: RunRecord,
    overrides: Overrides,
    time_constant_s: float,
    blank: BlankFile | None = None,
    other_parts: RunRecord | None = None,
) -> ChargeFrames:
    """Return a run's charges and photographs, without those before its blank is clean.

    Parameters
    ----------
    run
        A recorded run.
    overrides
        The user's settings.
    time_constant_s
        Time constant in seconds with which the lamp's housing warms and cools.
    blank
        Stray light of the bench; None if it was not measured.
    other_parts
        Record of other units, for which the lamp burned meanwhile; None if there are none.

    Raises
    ------
    DataError
        There are no charges through the filter, or none without it, or no photographs; or the blank
        never became dark.
    """
    charges = _intervals(run)
    own_units = {interval.unit for interval in charges}
    burned = [] if other_parts is None else _intervals(other_parts)
    by_lamp = sorted(
        (interval for interval in (*charges, *burned) if not interval.is_led), key=_begin
    )
    warmed = [
        interval for interval in with_warmth(by_lamp, time_constant_s) if interval.unit in own_units
    ]
    by_leds = [interval for interval in charges if interval.is_led]
    intervals = sorted([*warmed, *by_leds], key=_begin)
    frames = [
        frame for role in GLOWING for frame in run.frames(role) if not overrides.excludes(frame)
    ]
    frames.sort(key=lambda frame: frame.start_time)
    interval_of = {frame: _interval_before(intervals, frame) for frame in frames}
    charge_of = {frame: interval for frame, interval in interval_of.items() if interval is not None}
    left_out: tuple[ResultWarning, ...] = ()
    if blank is not None and charge_of:
        charge_of, left_out = _without_stray_light(charge_of, blank)
    if not charge_of or len({interval.is_direct for interval in intervals}) < 2:
        raise DataError(
            f"{run.folder}: expected complete charges through the filter and without it; go on "
            f"with: labrig resume {run.folder}"
        )
    return ChargeFrames(intervals, charge_of, left_out)


def _intervals(run: RunRecord) -> list[ChargeInterval]:
    units = (_interval(attempt) for attempt in run.completed().values())
    return sorted((interval for interval in units if interval is not None), key=_begin)


def _begin(interval: ChargeInterval) -> float:
    return interval.on_s


def _without_stray_light(
    charge: Mapping[FrameRecord, ChargeInterval], blank: BlankFile
) -> tuple[dict[FrameRecord, ChargeInterval], tuple[ResultWarning, ...]]:
    after_s = {frame: frame.start_time - interval.off_s for frame, interval in charge.items()}
    left_out = left_out_warnings(list(after_s.values()), blank)
    return {frame: charge[frame] for frame, t in after_s.items() if blank.is_clean(t)}, left_out


def with_warmth(
    intervals: Sequence[ChargeInterval], time_constant_s: float
) -> list[ChargeInterval]:
    """Set the warm-up deficit of each charge by Newton's law.

    The lamp is cold before the first charge, warms in each one and cools after it.
    """
    warmed: list[ChargeInterval] = []
    deficit, since_s = 1.0, 0.0
    for interval in intervals:
        if warmed:
            deficit = 1 - (1 - deficit) * math.exp(-(interval.on_s - since_s) / time_constant_s)
        charge_s = interval.off_s - interval.on_s
        mean_fraction = -math.expm1(-charge_s / time_constant_s) * time_constant_s / charge_s
        warmed.append(replace(interval, cold_deficit=deficit * mean_fraction))
        deficit, since_s = deficit * math.exp(-charge_s / time_constant_s), interval.off_s
    return warmed


def _interval(attempt: Attempt) -> ChargeInterval | None:
    switched = [action for action in attempt.actions if action.device in (LAMP.key, LEDS.key)]
    off = [action for action in switched if action.action == DARK]
    on = [action for action in switched if action.action != DARK]
    if not on or not off:
        return None
    is_led = on[-1].device == LEDS.key
    return ChargeInterval(attempt.unit, on[-1].middle_time, off[-1].middle_time, is_led)


def _interval_before(
    intervals: Sequence[ChargeInterval], frame: FrameRecord
) -> ChargeInterval | None:
    """Return the last charge before a frame.

    It is None if there was none, or none in the same arrangement of filter and lamp.
    """
    earlier = [interval for interval in intervals if interval.off_s < frame.start_time]
    if not earlier or earlier[-1].is_direct is not UnitKind.DIRECT.has(frame.unit):
        return None
    return earlier[-1]
