"""Comparison of a run with photographs, other materials and the paper of Nalbach et al."""

from labrig.compare.numbers import lamps_numbers, numbers, rendered_numbers
from labrig.compare.page_sections import lamps_sections, rendered_sections, sections
from labrig.compare.photographed_room import DarkRoomScene
from labrig.compare.rendered import (
    GlowRatio,
    RenderedComparison,
    RenderedPatch,
    compare_rendered,
    write_rendered,
)
from labrig.compare.rendered_lamps import (
    LampsComparison,
    RenderedLamp,
    RenderedSample,
    compare_lamps,
    is_of_fluorescence,
)
from labrig.compare.run import RunComparison, compare_run
from labrig.compare.three_channels import ThreeChannels, three_channels

__all__ = [
    "DarkRoomScene",
    "GlowRatio",
    "LampsComparison",
    "RenderedComparison",
    "RenderedLamp",
    "RenderedPatch",
    "RenderedSample",
    "RunComparison",
    "ThreeChannels",
    "compare_lamps",
    "compare_rendered",
    "compare_run",
    "is_of_fluorescence",
    "lamps_numbers",
    "lamps_sections",
    "numbers",
    "rendered_numbers",
    "rendered_sections",
    "sections",
    "three_channels",
    "write_rendered",
]
