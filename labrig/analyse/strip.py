"""The filter's strip in a run: its frames, and its slices in every patch.

The slices of a patch are those rows of the strip's slices that lie in its region. Their light is
that of the same place along the strip.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from labrig.analyse.frames import require_calibrated_camera, steady_frames
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CAMERA_KIND
from labrig.foundation.activity import counted
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region, region_pixels
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.optics import SLICES, Strip
from labrig.record import FrameRole
from labrig.reduce import (
    FoundStrip,
    HotPixels,
    SensorLayout,
    SeriesFrame,
    find_strip_in,
    hot_pixels_of,
    sensor_layout,
    strip_profile_in,
)
from labrig.results import StripProfile


class StripFrames:
    """Frames of a run's completed units by role, as they were recorded.

    Raises
    ------
    DataError
        There are no frames of a role, they are damaged, or they are of another camera than the
        calibrated one.
    """

    def __init__(self, context: AnalysisContext) -> None:
        self._part = context
        self.dark = self.of(FrameRole.DARK)
        require_calibrated_camera(
            context.inputs[CAMERA_KIND], context.run, context.run.frames(FrameRole.DARK)
        )

    def of(self, role: str, unit: str | None = None) -> list[SeriesFrame]:
        """Return the frames of a role, and of one unit if it is given."""
        frames = [
            frame
            for frame in steady_frames(self._part.run, self._part.overrides, role)
            if unit is None or frame.unit == unit
        ]
        if not frames:
            raise DataError(
                f"{self._part.run.folder}: the unit {unit or role} is not complete; go on "
                f"with: labrig resume {self._part.run.folder}"
            )
        return frames

    def find_strip(self, role: str, unit: str | None = None) -> FoundStrip:
        """Find the lit strip in all frames of a role, combined into one."""
        return find_strip_in(self.of(role, unit), self.hot)

    def profile(self, role: str, strip: Strip) -> StripProfile:
        """Average all frames of a role, combined into one, across a strip."""
        return strip_profile_in(self.of(role), strip, self.hot)

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height of the frames in pixels."""
        layout = sensor_layout(self.dark[0])
        return layout.width, layout.height

    @cached_property
    def hot(self) -> HotPixels | None:
        """Pixels that are bright in the dark; None if there are too few frames."""
        return hot_pixels_of(self.dark)


Found = TypeVar("Found")
Slices = dict[str, Region]

#: Fewest rows of colour-filter cells of a patch: a single one does not determine the noise.
MIN_CELLS = 2


@dataclass(frozen=True)
class StripPatch:
    """Rows of a strip that a patch covers.

    Attributes
    ----------
    name
        Name of the patch in the protocol; empty where it names none.
    material
        Name of the sample in the patch.
    region
        Region of the patch in the frame; None is all of the strip.
    alone
        Whether it is the only patch.
    """

    name: str
    material: str
    region: Region | None = None
    alone: bool = True

    @property
    def folder(self) -> str:
        """Name of the patch's folder below a result; empty for the only patch."""
        return "" if self.alone else self.name

    def own(self, entries: Mapping[str, Found]) -> Found | None:
        """Return the patch's entry in an earlier result by patch.

        The only patch takes the only entry, whatever its name.
        """
        if self.alone and len(entries) == 1:
            return next(iter(entries.values()))
        return entries.get(self.name)


def strip_regions(context: AnalysisContext) -> list[StripPatch]:
    """Return the patches of a part's protocol, with the user's regions instead.

    Raises
    ------
    UsageError
        There is no patch of a name that the user gives a region.
    """
    protocol = context.protocol
    if not protocol.patches:
        return [StripPatch("", protocol.sample.name)]
    regions = context.overrides.patches(protocol)
    alone = len(regions) == 1
    return [
        StripPatch(name, protocol.sample.name if alone else name, region, alone)
        for name, region in regions.items()
    ]


def slice_strip(
    patches: Sequence[StripPatch], strip: Strip, layout: SensorLayout, count: int = SLICES
) -> tuple[dict[StripPatch, Slices], tuple[ResultWarning, ...]]:
    """Return the strip's slices in the rows of every patch, and a warning of patches without any.

    Parameters
    ----------
    patches
        Patches on the strip.
    strip
        Place of the strip in the frames.
    layout
        Size and colours of the sensor.
    count
        Number of slices.

    Raises
    ------
    DataError
        No patch has any slices.
    """
    slices, reasons = {}, []
    for patch in patches:
        try:
            slices[patch] = _patch_slices(patch, strip, layout, count)
        except DataError as error:
            reasons.append(Unmeasured("patch-off-strip", "{reason}", reason=str(error)))
    if not slices:
        raise DataError("; ".join(map(str, reasons)))
    return slices, tuple(reasons)


def _patch_slices(patch: StripPatch, strip: Strip, layout: SensorLayout, count: int) -> Slices:
    strip_slices = strip.slices(count)
    if patch.region is None:
        return strip_slices
    x, y, wide, high = region_pixels(patch.region, layout.width, layout.height)
    top, bottom = y / layout.height, (y + high) / layout.height
    slices: Slices = {}
    for name, (left, upper, width, height) in strip_slices.items():
        first, last = max(upper, top), min(upper + height, bottom)
        slices[name] = (left, first, width, last - first)
    rows = [
        round((y + h) * layout.height) - round(y * layout.height) for _, y, _, h in slices.values()
    ]
    ends = [round(end[0] * layout.width) for end in (strip.left, strip.right)]
    if min(rows) >= MIN_CELLS * layout.cfa_side and x <= ends[0] and x + wide >= ends[1]:
        return slices
    upper = min(y for _, y, _, _ in strip_slices.values()) * layout.height
    lower = max(y + h for _, y, _, h in strip_slices.values()) * layout.height
    problem = (
        f"expected patch {patch.name} below the filter from end to end, in "
        f"{MIN_CELLS * layout.cfa_side} rows or more of its own: the filter lies in columns "
        f"{ends[0]} to {ends[1]} and rows {upper:.0f} to {lower:.0f}, the patch in columns {x} to "
        f"{x + wide} and rows {y} to {y + high} ({max(min(rows), 0)} in common)"
    )
    raise DataError(f"{problem}; move it: labrig process RUN --roi {patch.name}=x,y,width,height")


def tilt_offset(strip: Strip, slices: Slices, layout: SensorLayout) -> FloatArray:
    """Return the offset of slices along a tilted strip from the position of their columns, (P,).

    It is 0 in the strip's middle rows, and a fraction of its length, positive to the right, in the
    rows above and below, which belong to other places of the strip.
    """
    size = np.array([layout.width, layout.height])
    left, right = np.array(strip.left) * size, np.array(strip.right) * size
    across, down = right - left
    middles = np.array([(x + width / 2, y + height / 2) for x, y, width, height in slices.values()])
    x, y = (middles * size).T
    below = y - (left[1] + (x - left[0]) * down / across)
    return np.asarray(below * down / (across**2 + down**2))


def for_each_patch(
    patches: Sequence[StripPatch],
    analyse: Callable[[StripPatch], tuple[Found, Sequence[ResultWarning]]],
) -> tuple[dict[str, Found], tuple[ResultWarning, ...]]:
    """Analyse every patch, and return the results by the patch's folder, and warnings.

    A patch that cannot be analysed is a warning, as long as another one can.

    Raises
    ------
    DataError
        No patch can be analysed.
    """
    results: dict[str, Found] = {}
    warnings: list[ResultWarning] = []
    failures: list[DataError] = []
    for patch in counted(patches, "analysing patches"):
        name = "" if patch.alone else patch.name
        try:
            results[patch.folder], patch_warnings = analyse(patch)
        except DataError as error:
            failures.append(type(error)(f"{name}: {error}" if name else str(error)))
            patch_warnings = [Unmeasured("patch-failed", "{reason}", reason=str(error))]
        warnings += [warning.about(name) for warning in patch_warnings]
    if not results:
        raise failures[0]
    return results, tuple(warnings)
