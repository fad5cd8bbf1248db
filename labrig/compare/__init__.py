"""Comparison of a run with photographs, other materials and the paper of Nalbach et al."""

from labrig.compare.dark_room_view import DarkRoomScene
from labrig.compare.glow_ratio import GlowRatio, RenderedPatch
from labrig.compare.lamps_sections import lamps_sections
from labrig.compare.numbers import lamps_numbers, numbers, rendered_numbers
from labrig.compare.rendered import RenderedComparison, compare_rendered
from labrig.compare.rendered_lamps import (
    LampsComparison,
    RenderedLamp,
    RenderedSample,
    compare_lamps,
    is_of_fluorescence,
)
from labrig.compare.rendered_sections import rendered_sections
from labrig.compare.rendered_table import write_rendered
from labrig.compare.run import RunComparison, compare_run
from labrig.compare.sections import sections
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
