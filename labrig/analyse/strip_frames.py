"""The frames of a part that photographs strips."""

from functools import cached_property

from labrig.analyse.hot_pixels import hot_pixels_of
from labrig.analyse.part import Part
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import steady_frames
from labrig.errors import DataError
from labrig.record import FrameRole
from labrig.reduce import HdrFrame, PixelMask, SeriesFrame, read_hdr_frame, read_raw


class StripFrames:
    """By purpose; those of completed units, as they were recorded.

    Raises
    ------
    DataError
        None with a purpose that is asked for, or they are damaged, or of another camera than the
        one that is known.
    """

    def __init__(self, part: Part) -> None:
        self._part = part
        self.dark = self.of(FrameRole.DARK)
        insist_on_this_camera(part.inputs.camera, part.run, part.run.frames(FrameRole.DARK))

    def of(self, purpose: str, unit: str | None = None) -> list[SeriesFrame]:
        """Of a purpose, and of one unit where that matters."""
        frames = [
            frame
            for frame in steady_frames(self._part.run, self._part.choices, purpose)
            if unit is None or frame.unit == unit
        ]
        if not frames:
            raise DataError(
                f"{self._part.run.folder}: the unit {unit or purpose} is not complete; go on "
                f"with: labrig resume {self._part.run.folder}"
            )
        return frames

    def hdr(self, purpose: str, unit: str | None = None) -> HdrFrame:
        """All of them together."""
        return read_hdr_frame(self.of(purpose, unit), self.hot)

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        raw = read_raw(self.dark[0].path)
        return raw.width, raw.height

    @cached_property
    def hot(self) -> PixelMask | None:
        """Pixels that are bright in the dark, where there are frames to tell."""
        return hot_pixels_of(self.dark)
