"""What the user says of a table where the table itself leaves it open."""

from dataclasses import dataclass

from labrig.foundation.errors import UsageError
from labrig.text_table import DECIMAL_MARKS
from labrig.text_table.names import time_unit_s
from labrig.text_table.times import is_clock_form, parse_width


@dataclass(frozen=True)
class TableLayout:
    """Answers to what a table itself may leave open; None finds the answer in the table.

    Attributes
    ----------
    time
        Name of the column of times.
    column
        Name of the column of values.
    time_unit
        Unit of the times, such as `ms`, or the form of a clock, such as `hh:mm` or `dd/mm/yyyy`.
    decimal
        Decimal mark of the numbers, `point` or `comma`.
    time_per_channel
        Width of a channel with its unit, such as `0.4 ns`, where rows or numbers of channels stand
        for times.
    block
        Number of the table, from 1, of several in the file.
    """

    time: str | None = None
    column: str | None = None
    time_unit: str | None = None
    decimal: str | None = None
    time_per_channel: str | None = None
    block: int | None = None

    def __post_init__(self) -> None:
        unit = self.time_unit
        if unit is not None and time_unit_s(unit) is None and not is_clock_form(unit):
            raise UsageError(
                "--time-unit: expected a unit such as ns, ms, s, min or h, or the form of a clock "
                f"such as hh:mm or dd/mm/yyyy, got '{unit}'"
            )
        if self.decimal is not None and self.decimal not in DECIMAL_MARKS:
            raise UsageError(f"--decimal: expected 'point' or 'comma', got '{self.decimal}'")
        if self.time_per_channel is not None and parse_width(self.time_per_channel) is None:
            raise UsageError(
                "--time-per-channel: expected a time above 0 with its unit, such as '0.4 ns', got "
                f"'{self.time_per_channel}'"
            )
