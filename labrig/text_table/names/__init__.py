"""Meaning of the names of columns and of their units."""

from labrig.text_table.names.columns import (
    ABSCISSAS,
    is_abscissa,
    is_abscissa_unit,
    is_channel,
    is_row_number,
    is_sigma,
    is_time,
    sigma_of,
    split_time,
    split_unit,
    time_unit_s,
)
from labrig.text_table.names.value_units import LogScale, is_absorbance, log_scale

__all__ = [
    "ABSCISSAS",
    "LogScale",
    "is_abscissa",
    "is_abscissa_unit",
    "is_absorbance",
    "is_channel",
    "is_row_number",
    "is_sigma",
    "is_time",
    "log_scale",
    "sigma_of",
    "split_time",
    "split_unit",
    "time_unit_s",
]
