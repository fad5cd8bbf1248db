"""Rows that are no measurements, and limits of what measured them."""

from labrig.text_table.rows.detector_limits import at_ceiling, at_floor
from labrig.text_table.rows.no_measurement import no_measurements
from labrig.text_table.rows.repeated_readings import held_readings, repeated_rows
from labrig.text_table.rows.time_order import backward_rows, light_goes_on, starts_again

__all__ = [
    "at_ceiling",
    "at_floor",
    "backward_rows",
    "held_readings",
    "light_goes_on",
    "no_measurements",
    "repeated_rows",
    "starts_again",
]
