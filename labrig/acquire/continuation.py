"""Continuation of a run that was begun before, and the pace of its devices so far."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from labrig.record import UNDONE, ActionRecord, Attempt, FrameRecord, RunRecord

#: Times up to this multiple of the shortest one are those of a device; others include a wait.
AT_ONCE = 1.25


@dataclass(frozen=True)
class Pace:
    """Times that devices take, beyond what is asked of them.

    Attributes
    ----------
    frame_time_s
        Time from the end of an exposure to the start of the next one, in seconds.
    change_s
        Time by which other settings of the camera prolong it, in seconds.
    reading_s
        Time of a reading of the thermometer in seconds, with which a unit begins and ends.
    """

    frame_time_s: float
    change_s: float = 0.0
    reading_s: float = 0.0


@dataclass(frozen=True)
class Continuation:
    """Place at which a run that was begun before goes on.

    Attributes
    ----------
    record
        Record of the run up to now.
    connected_time
        Time at which the devices were connected, in seconds since 1970: they warm up from then on.
    time
        Time at which the run goes on, in seconds since 1970.
    """

    record: RunRecord
    connected_time: float
    time: float

    def pace(self, declared: Pace) -> Pace:
        """Return the pace of the devices, as the record shows it.

        Parameters
        ----------
        declared
            Pace as the driver declares it, the longest, which counts until there are frames.
        """
        pairs = [pair for attempt in self.record.attempts for pair in pairwise(attempt.frames)]
        alike = [_gap_s(*pair) for pair in pairs if _settings(pair[0]) == _settings(pair[1])]
        others = [_gap_s(*pair) for pair in pairs if _settings(pair[0]) != _settings(pair[1])]
        frame_time_s = min(_at_once_s(alike, declared.frame_time_s), declared.frame_time_s)
        change_s = max(_at_once_s(others, frame_time_s + declared.change_s) - frame_time_s, 0.0)
        if declared.change_s:
            change_s = min(change_s, declared.change_s)
        readings_s = [2 * half_s for each in self.record.attempts for half_s in _reading_s(each)]
        # A longer one waited for a sequence to begin.
        return Pace(
            frame_time_s,
            change_s if change_s < frame_time_s else 0.0,
            median(readings_s) if readings_s else 0.0,
        )

    def burns(self, lamp: str, switched_on: str) -> bool:
        """Return whether a lamp has been on since a unit before, by its key and the action.

        To connect devices, and to take a step back, switches it off.
        """
        switched = [
            action.action
            for action in self.all_actions
            if action.device in (lamp, UNDONE) and action.start_time >= self.connected_time
        ]
        return switched[-1:] == [switched_on]

    @property
    def completed_actions(self) -> list[ActionRecord]:
        """Actions of completed units."""
        return [a for attempt in self.record.completed().values() for a in attempt.actions]

    @property
    def all_actions(self) -> list[ActionRecord]:
        """Actions of all attempts."""
        return [action for attempt in self.record.attempts for action in attempt.actions]


def _gap_s(before: FrameRecord, after: FrameRecord) -> float:
    return after.start_time - before.end_time


def _settings(frame: FrameRecord) -> tuple[float, int, float | None]:
    return frame.exposure_s, frame.iso, frame.f_number


def _at_once_s(gaps_s: Sequence[float], otherwise_s: float) -> float:
    """Return the typical gap between frames that nothing else keeps apart."""
    if not gaps_s:
        return otherwise_s
    return median(gap_s for gap_s in gaps_s if gap_s <= AT_ONCE * min(gaps_s))


def _reading_s(attempt: Attempt) -> Iterator[float]:
    """Yield half of the time of the reading with which an attempt begins, if there is one."""
    if attempt.temperatures:
        yield max(attempt.temperatures[0].time - float(attempt.start["time"]), 0.0)
