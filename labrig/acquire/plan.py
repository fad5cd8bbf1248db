"""The plan of a run: its timeline, with the longest durations and the largest number of frames."""

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass

from labrig.acquire.roles import CAMERA
from labrig.acquire.values import CameraOffers
from labrig.record import PERSON, RunSize


@dataclass(frozen=True)
class Step:
    """One line of the timeline.

    Attributes
    ----------
    at_s
        Begin of the step in seconds after the start of the run.
    unit
        Name of the unit.
    device
        Key of the device, `PERSON` for a step by hand, `-` for a wait or a warning.
    action
        Action as text.
    exposure_s
        Shutter time of a photograph in seconds; None for all other steps.
    lasts_s
        Duration of a wait in seconds; None for all other steps.
    """

    at_s: float
    unit: str
    device: str
    action: str
    exposure_s: float | None = None
    lasts_s: float | None = None


@dataclass(frozen=True)
class Plan:
    """Timeline of a run, with the longest durations and the largest number of frames.

    Attributes
    ----------
    steps
        Steps in order of time.
    units
        Names of the units in order.
    unit_ends_s
        End of each unit in seconds after the start of the run.
    offers
        Settings that the camera offers.
    patches
        Largest number of patches of a unit.
    """

    steps: tuple[Step, ...]
    units: tuple[str, ...]
    unit_ends_s: tuple[float, ...]
    offers: CameraOffers
    patches: int = 1

    @property
    def duration_s(self) -> float:
        """Lab time of the whole run in seconds."""
        return self.unit_ends_s[-1] if self.unit_ends_s else 0.0

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.size().frames

    @property
    def size_bytes(self) -> int:
        """Size of frames and results on disk in bytes."""
        return self.size().total_bytes

    def size(self, done: Collection[str] = ()) -> RunSize:
        """Return the size on disk to be expected of the units that are not done yet."""
        frames = sum(step.device == CAMERA.key and step.unit not in done for step in self.steps)
        return RunSize.expected(frames, self.offers.frame_bytes, self.patches)

    @property
    def manual_steps(self) -> tuple[str, ...]:
        """Steps to be done by hand."""
        return tuple(step.action for step in self.steps if step.device == PERSON)

    def lines(self) -> list[str]:
        """Return the timeline as lines `@t (+dt) device action`, with a heading for each unit."""
        lines, unit, before_s = [], "", 0.0
        for step in self.steps:
            if step.unit != unit:
                unit = step.unit
                lines.append(f"unit {unit}")
            lines.append(
                f"  @{step.at_s:10.3f} s (+{step.at_s - before_s:9.3f} s)  "
                f"{step.device:8} {step.action}"
            )
            before_s = step.at_s
        return lines

    def to_json(self) -> str:
        """Return the timeline as JSON."""
        size = self.size()
        content = {
            "units": self.units,
            "duration_s": self.duration_s,
            "manual_steps": len(self.manual_steps),
            "frames": size.frames,
            "frames_bytes": size.frames_bytes,
            "size_bytes": size.total_bytes,
            "steps": [asdict(step) for step in self.steps],
        }
        return json.dumps(content, ensure_ascii=False)
