"""Follows a run folder as it is written: what is done, what comes, the decay so far."""

import math
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from labrig.acquire import Plan, ProtocolModel, plan, read_protocol, read_rig_file
from labrig.catalogue import is_being_written, summarise
from labrig.errors import DataError, LabrigError, UsageError
from labrig.record import Attempt, FrameRecord, RunRecord, read_run
from labrig.region import Region
from labrig.results import read_fitted_decays
from labrig.watch.glance import Glance, glance
from labrig.written_numbers import plus_minus

PICTURE_WIDTH = 720


@dataclass(frozen=True)
class Point:
    """One frame of a decay in one patch: mean above black per second, by channel; not the result.

    `t_s` counts from lamp off.
    """

    patch: str
    unit: str
    t_s: float
    exposure_s: float
    dn_per_s: dict[str, float]
    clipped: bool


class Following:
    """One run, seen from its folder alone; looking twice costs little if nothing has changed.

    Parameters
    ----------
    run
        The run folder; it may still be empty but for protocol and rig.

    Raises
    ------
    UsageError
        Not a run folder.
    """

    def __init__(self, run: Path) -> None:
        if not (run / "protocol.yaml").is_file():
            raise UsageError(f"{run}: expected a run folder with protocol.yaml in it; see --runs")
        self.run = run
        self.protocol: ProtocolModel = read_protocol(run / "protocol.yaml")
        rig = read_rig_file(run / "rig.yaml")
        self.is_simulated = rig.simulation is not None
        self.plan: Plan = plan(self.protocol, rig, str(run / "rig.yaml"))
        self.patches: dict[str, Region] = dict(getattr(self.protocol, "patches", {}))
        self._seen: tuple[object, ...] = ()
        self._record: RunRecord | None = None
        self._points: dict[str, tuple[Point, ...]] = {}
        self.latest: Glance | None = None
        self._latest_frame: FrameRecord | None = None

    def look(self) -> bool:
        """Take in what is new; whether there is anything.

        Raises
        ------
        DataError
            The journal is damaged.
        """
        seen = (
            _size(self.run / "journal.jsonl"),
            _size(self.run / "result" / "report.html"),
            is_being_written(self.run),
        )
        if seen == self._seen:
            return False
        self._seen = seen
        if seen[0]:
            self._record = read_run(self.run)
            for attempt in self._record.attempts:
                self._take_in(attempt)
        return True

    def state(self) -> dict[str, Any]:
        """All of it, for a page: plain values, times in seconds since 1970."""
        record = self._record
        attempts = [] if record is None else record.attempts
        open_one = next((a for a in reversed(attempts) if a.exit_status is None), None)
        return {
            "run": self.run.name,
            "sample": self.protocol.sample.name,
            "protocol": self.protocol.protocol,
            "state": summarise(self.run).state,
            "simulated": self.is_simulated,
            "began_time": attempts[0].start["time"] if attempts else None,
            "last_time": None if record is None else record.last_time,
            "units": self._units(attempts),
            "steps": [] if open_one is None else self._steps(open_one.unit),
            "unit_began_time": None if open_one is None else open_one.start["time"],
            "frames": sum(len(attempt.frames) for attempt in attempts),
            "planned_frames": self.plan.frames,
            "points": [asdict(p) for points in self._points.values() for p in points],
            "frame": self._frame(),
            "trouble": [
                f"{attempt.unit}: {attempt.reason}"
                for attempt in attempts
                if attempt.exit_status not in (None, "success")
            ],
            "disk_free_bytes": shutil.disk_usage(self.run).free,
            "results": self._results(),
        }

    def _take_in(self, attempt: Attempt) -> None:
        """Look at the frames that were not there before."""
        off_times = [
            action.middle_time
            for action in attempt.actions
            if (action.device, action.action) == ("lamp", "off")
        ]
        for frame in attempt.frames:
            if frame.path.name in self._points:
                continue
            try:
                seen = glance(frame.path, self.patches, PICTURE_WIDTH)
            except LabrigError:  # processing says so; watching goes on
                self._points[frame.path.name] = ()
                continue
            self.latest, self._latest_frame = seen, frame
            before = [time for time in off_times if time <= frame.start_time]
            is_decay = frame.purpose == "decay" and bool(before)
            self._points[frame.path.name] = _points(frame, seen, before[-1]) if is_decay else ()

    def _units(self, attempts: Sequence[Attempt]) -> list[dict[str, Any]]:
        done = {attempt.unit for attempt in attempts if attempt.completed}
        under_way = {attempt.unit for attempt in attempts if attempt.exit_status is None}
        begins_s, units = 0.0, []
        for name, ends_s in zip(self.plan.units, self.plan.unit_ends_s, strict=True):
            state = "done" if name in done else "now" if name in under_way else "to do"
            tries = sum(attempt.unit == name for attempt in attempts)
            units.append(
                {"name": name, "state": state, "planned_s": ends_s - begins_s, "tries": tries}
            )
            begins_s = ends_s
        return units

    def _steps(self, unit: str) -> list[dict[str, Any]]:
        """What the plan has for a unit, in seconds after its start."""
        number = self.plan.units.index(unit)
        begins_s = self.plan.unit_ends_s[number - 1] if number else 0.0
        return [
            {"at_s": step.at_s - begins_s, "what": f"{step.device} {step.action}".lstrip("- ")}
            for step in self.plan.steps
            if step.unit == unit
        ]

    def _frame(self) -> dict[str, Any] | None:
        frame, seen = self._latest_frame, self.latest
        if frame is None or seen is None:
            return None
        return {
            "name": frame.path.name,
            "purpose": frame.purpose,
            "exposure_s": frame.exposure_s,
            "iso": frame.iso,
            "f_number": frame.f_number,
            "start_time": frame.start_time,
            "late_s": frame.late_s,
            "brightened": seen.brightened,
            "values": seen.values,
            "clipped": seen.clipped,
            "width": seen.picture.shape[1],
            "height": seen.picture.shape[0],
        }

    def _results(self) -> list[dict[str, str]]:
        try:
            results = read_fitted_decays(self.run / "result")
        except DataError:
            return []
        order = {name: number for number, name in enumerate(self.patches)}
        return [
            {
                "patch": name or next(iter(self.patches), ""),
                "rates": ", ".join(plus_minus(rate.value, rate.sigma) for rate in fit.rates),
            }
            for name, fit in sorted(results.items(), key=lambda one: order.get(one[0], 0))
        ]


def _points(frame: FrameRecord, seen: Glance, lamp_off_time: float) -> tuple[Point, ...]:
    return tuple(
        Point(
            patch,
            frame.unit,
            frame.start_time - lamp_off_time,
            frame.exposure_s,
            {
                channel: mean / frame.exposure_s
                for channel, mean in values.items()
                if math.isfinite(mean)
            },
            patch in seen.clipped,
        )
        for patch, values in seen.values.items()
    )


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0
