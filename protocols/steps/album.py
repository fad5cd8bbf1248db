"""Frames that a protocol decides by, each measured once: reading one takes a second on a bench."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from labrig.record import FrameRecord
from labrig.region import Region

from .metering import Look, look


@dataclass(frozen=True)
class Album:
    """Looks at frames, always in the same regions.

    Attributes
    ----------
    regions
        Where to measure.
    """

    regions: Sequence[Region]
    _looks: dict[Path, Look] = field(default_factory=dict, repr=False, compare=False)

    def look(self, frame: FrameRecord) -> Look:
        """What a frame shows."""
        if frame.path not in self._looks:
            self._looks[frame.path] = look(frame, self.regions)
        return self._looks[frame.path]
