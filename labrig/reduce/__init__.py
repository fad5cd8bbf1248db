"""From a RAW file to linear values of each channel with uncertainties, and to a time series."""

from labrig.reduce.channels import ChannelStats, FrameMeasurement, measure
from labrig.reduce.dark import DarkModel, fit_dark, hot_pixels
from labrig.reduce.joined import joined
from labrig.reduce.patches import reduce_patches, reduce_series
from labrig.reduce.planes import PixelMask
from labrig.reduce.raw import RawFrame, read_raw
from labrig.reduce.series import Series, add_flag, write_series
from labrig.reduce.series_table import parse_series, read_series
from labrig.reduce.shots import SeriesFrame

__all__ = [
    "ChannelStats",
    "DarkModel",
    "FrameMeasurement",
    "PixelMask",
    "RawFrame",
    "Series",
    "SeriesFrame",
    "add_flag",
    "fit_dark",
    "hot_pixels",
    "joined",
    "measure",
    "parse_series",
    "read_raw",
    "read_series",
    "reduce_patches",
    "reduce_series",
    "write_series",
]
