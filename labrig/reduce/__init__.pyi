from .black_cut_off import (
    BlackCutOff as BlackCutOff,
    find_cut_off as find_cut_off,
)
from .colour_chart import (
    find_colour_chart as find_colour_chart,
)
from .dark import (
    DarkModel as DarkModel,
    fit_dark as fit_dark,
)
from .frame_metadata import (
    SensorLayout as SensorLayout,
    frames_exif as frames_exif,
    sensor_layout as sensor_layout,
)
from .glare import (
    FRAME_TILES as FRAME_TILES,
    WHOLE_FRAME as WHOLE_FRAME,
    WHOLE_FRAME_NAME as WHOLE_FRAME_NAME,
    frame_series as frame_series,
)
from .hdr import (
    HdrFrame as HdrFrame,
    read_hdr_frame as read_hdr_frame,
)
from .hot_pixels import (
    BrightPixels as BrightPixels,
    HotPixels as HotPixels,
    hot_pixels as hot_pixels,
    hot_pixels_of as hot_pixels_of,
)
from .linear_frame import (
    LinearFrame as LinearFrame,
    RegionSums as RegionSums,
    cell_means_dn as cell_means_dn,
    saturated_cells as saturated_cells,
)
from .measured_frames import (
    SeriesFrame as SeriesFrame,
    measure_region as measure_region,
)
from .pair_noise import (
    STRIPS as STRIPS,
)
from .photon_transfer import (
    NoiseModel as NoiseModel,
    variance_terms as variance_terms,
)
from .pictures import (
    MakeThumbnail as MakeThumbnail,
    Picture as Picture,
    SaturatedFraction as SaturatedFraction,
    Thumbnail as Thumbnail,
    binned as binned,
    is_grey as is_grey,
    jpeg as jpeg,
    png as png,
    small as small,
)
from .raw import (
    Exif as Exif,
    RawFrame as RawFrame,
    read_exif as read_exif,
    read_raw as read_raw,
)
from .region_levels import (
    ChannelStats as ChannelStats,
    FrameMeasurement as FrameMeasurement,
    PixelMask as PixelMask,
    measure as measure,
    measure_regions as measure_regions,
)
from .rounding import (
    ROUNDING_VARIANCE as ROUNDING_VARIANCE,
    rounded_variance as rounded_variance,
    rounding_slope as rounding_slope,
    shared_rounding_variance as shared_rounding_variance,
    unrounded_variance as unrounded_variance,
)
from .saturation import (
    is_clipped as is_clipped,
)
from .series import (
    TWO_DEGREES as TWO_DEGREES,
    reduce_patches as reduce_patches,
    reduce_series as reduce_series,
)
from .strip import (
    FLICKER as FLICKER,
    FoundStrip as FoundStrip,
    find_strip as find_strip,
    find_strip_in as find_strip_in,
    region_values as region_values,
    slice_values as slice_values,
    strip_profile as strip_profile,
    strip_profile_in as strip_profile_in,
)
from .workers.pool import (
    WORTHWHILE_BYTES as WORTHWHILE_BYTES,
    Reduction as Reduction,
)
from .workers.reduction import (
    Exposure as Exposure,
    StoredFrame as StoredFrame,
    reduce_frames as reduce_frames,
    reduce_groups as reduce_groups,
)
