from .channels import (
    ChannelStats as ChannelStats,
    FrameMeasurement as FrameMeasurement,
    PixelMask as PixelMask,
    measure as measure,
)
from .dark import (
    DarkModel as DarkModel,
    fit_dark as fit_dark,
    hot_pixels as hot_pixels,
)
from .frame import (
    LinearFrame as LinearFrame,
    RegionSums as RegionSums,
    saturated_cells as saturated_cells,
)
from .hdr import (
    Exposure as Exposure,
    HdrFrame as HdrFrame,
    read_hdr_frame as read_hdr_frame,
)
from .measured_frames import (
    SeriesFrame as SeriesFrame,
)
from .pair_noise import (
    STRIPS as STRIPS,
)
from .photon_transfer import (
    ROUNDING_VARIANCE as ROUNDING_VARIANCE,
    NoiseModel as NoiseModel,
    variance_terms as variance_terms,
)
from .pictures import (
    Picture as Picture,
    binned as binned,
    is_grey as is_grey,
    jpeg as jpeg,
    small as small,
)
from .raw import (
    RawFrame as RawFrame,
    read_exif as read_exif,
    read_raw as read_raw,
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
    find_strip as find_strip,
    slice_values as slice_values,
    strip_profile as strip_profile,
)
