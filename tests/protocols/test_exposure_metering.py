"""Shutter times of a decay, from looks at a glow that is written down."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.acquire import CameraCapabilities
from labrig.protocols.steps.exposure_metering import TARGET, DecayMeter, MeteringFrame
from tests.protocols.metering import RANGE_DN, measure_frame

#: Shutter times so close that none is far from what is wanted.
OFFERS = CameraCapabilities(
    tuple(np.geomspace(1e-3, 30.0, 2000).tolist()), (400,), (4.0,), overhead_s=1.0, frame_bytes=10
)
RATE_DN_PER_S, K_PER_S = 1500.0, 0.02
TIMES_S = (0.0, 20.0, 40.0, 60.0)


def looks(peak_over_mean: float = 1.0) -> list[MeteringFrame]:
    """A glow of which the brightest pixels are brighter than the mean by that factor."""
    frames = []
    for t_s in TIMES_S:
        frame = measure_frame(t_s, 1.0, RATE_DN_PER_S * float(np.exp(-K_PER_S * t_s)))
        (patch,) = frame.patches
        green = patch.channels["G"]
        brighter = replace(green, peak=peak_over_mean * green.mean)
        seen = replace(patch, channels=dict(patch.channels) | {"G": brighter})
        frames.append(replace(frame, patches=[seen]))
    return frames


@pytest.mark.parametrize("peak_over_mean", [1.0, 2.0])
def test_the_brightest_pixels_fill_the_same_part_of_the_range(peak_over_mean: float) -> None:
    warnings: list[str] = []
    schedule = DecayMeter(looks(peak_over_mean)).schedule(
        TIMES_S, OFFERS, longest_s=30.0, growth=100.0, warn=warnings.append
    )
    peaks_dn = [
        peak_over_mean * RATE_DN_PER_S * np.exp(-K_PER_S * t_s) * exposure_s
        for t_s, exposure_s in schedule.frames()
    ]
    np.testing.assert_allclose(peaks_dn, TARGET * RANGE_DN, rtol=0.01)
    assert warnings == []


def test_growth_and_the_longest_time_limit_later_frames() -> None:
    schedule = DecayMeter(looks()).schedule(
        TIMES_S, OFFERS, longest_s=30.0, growth=1.5, warn=lambda _: None
    )
    first_s = schedule.exposures_s[0]
    assert schedule.exposures_s[-1] == pytest.approx(1.5 * first_s, rel=0.01)
    schedule = DecayMeter(looks()).schedule(
        TIMES_S, OFFERS, longest_s=5.0, growth=100.0, warn=lambda _: None
    )
    assert max(schedule.exposures_s) == pytest.approx(5.0, rel=0.01)
