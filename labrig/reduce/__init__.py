"""From a RAW file to linear values of each channel with uncertainties, and to a time series."""

from labrig.reduce.channels import ChannelStats, FrameMeasurement, measure
from labrig.reduce.dark import DarkModel, fit_dark, hot_pixels
from labrig.reduce.frame import LinearFrame, RegionSums
from labrig.reduce.patches import reduce_patches, reduce_series
from labrig.reduce.planes import PixelMask
from labrig.reduce.raw import RawFrame, read_raw
from labrig.reduce.shots import SeriesFrame

__all__ = [
    "ChannelStats",
    "DarkModel",
    "FrameMeasurement",
    "LinearFrame",
    "PixelMask",
    "RawFrame",
    "RegionSums",
    "SeriesFrame",
    "fit_dark",
    "hot_pixels",
    "measure",
    "read_raw",
    "reduce_patches",
    "reduce_series",
]
