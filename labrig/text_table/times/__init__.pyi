from .clock_times import (
    ClockReading as ClockReading,
    ClockTimes as ClockTimes,
    is_clock_form as is_clock_form,
    parse_clock as parse_clock,
    read_clock as read_clock,
)
from .statements import (
    ChannelWidth as ChannelWidth,
    axis_times_s as axis_times_s,
    axis_unit as axis_unit,
    channel_width as channel_width,
    parse_width as parse_width,
    quoted as quoted,
)
