from .band import (
    LedBand as LedBand,
    led_band as led_band,
    light_within as light_within,
)
from .brightness import (
    CURVES_OF_MODEL as CURVES_OF_MODEL,
    RESPONSE_CALIBRATED as RESPONSE_CALIBRATED,
    RESPONSE_UNKNOWN as RESPONSE_UNKNOWN,
    SKEW_SIGMA as SKEW_SIGMA,
    WIDTH_SIGMA as WIDTH_SIGMA,
    BrightnessFit as BrightnessFit,
    LedLightMeasured as LedLightMeasured,
    ResponseError as ResponseError,
    centroid_nm as centroid_nm,
    changed_spectrum as changed_spectrum,
    fit_brightness as fit_brightness,
)
from .identity import (
    ChannelMatch as ChannelMatch,
    match_channels as match_channels,
)
