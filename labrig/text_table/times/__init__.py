"""Times of rows: clocks in a column, units and widths of channels in lines about the table."""

from labrig.text_table.times.clock_times import (
    ClockReading,
    ClockTimes,
    is_clock_form,
    parse_clock,
    read_clock,
)
from labrig.text_table.times.statements import (
    ChannelWidth,
    axis_times_s,
    axis_unit,
    channel_width,
    parse_width,
    quoted,
)

__all__ = [
    "ChannelWidth",
    "ClockReading",
    "ClockTimes",
    "axis_times_s",
    "axis_unit",
    "channel_width",
    "is_clock_form",
    "parse_clock",
    "parse_width",
    "quoted",
    "read_clock",
]
