"""Looks at a scene that is written down instead of photographed."""

from labrig.protocols.steps.exposure_metering import MeteringFrame
from labrig.reduce import ChannelStats, FrameMeasurement

BLACK, WHITE = 1024.0, 15_600.0
RANGE_DN = WHITE - BLACK


def measure_frame(
    start_s: float,
    exposure_s: float,
    level_dn: float,
    black: float = BLACK,
    hot: float = 0.0,
    sigma: float = 0.05,
) -> MeteringFrame:
    """One patch whose green has this level above the file's black, clipped where it must.

    Parameters
    ----------
    hot
        Fraction of pixels that clip whatever the light.
    """
    n, full = 10_000, WHITE - black
    mean = (1 - hot) * min(level_dn, full) + hot * full
    saturated = n if level_dn >= full else round(hot * n)
    green = ChannelStats(mean, sigma, 10.0, mean, n, saturated, round(hot * n))
    red = ChannelStats(mean / 3, sigma, 10.0, mean / 3, n, 0, 0)
    return MeteringFrame(
        start_s,
        exposure_s,
        [
            FrameMeasurement(
                {"R": red, "G": green}, "RGGB", (black,) * 4, WHITE, 96, 64, exposure_s, 400, 4.0,
                None, None,
            )
        ],
    )  # fmt: skip
