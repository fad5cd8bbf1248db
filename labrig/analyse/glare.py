"""Patches for which the veiling glare of a lens may matter where it was not measured.

Light of the patch itself does not matter: a lens scatters it with the course of the patch's own.
"""

from collections.abc import Mapping

import numpy as np

from labrig.foundation.region import Region, region_pixels
from labrig.reduce import SensorLayout
from labrig.results import Series

#: Glare of a clean photographic lens, as a fraction of the frame's mean light.
USUAL_GLARE = 0.01
#: Flicker of a frame's light, common to all patches.
FLICKER = 0.007
#: Change of the course of a glow by the glare, in σ of all frames, and of its level, that matter.
COURSE_SIGMAS, LEVEL = 2.0, 0.01


def glare_warning(
    series: Mapping[str, Series],
    regions: Mapping[str, Region],
    frame: Series,
    layout: SensorLayout,
) -> tuple[str, ...]:
    """Return one line that names the patches for which a usual glare matters; empty for none.

    Parameters
    ----------
    series, regions
        Series of every patch, and its region.
    frame
        Series of the whole frame.
    layout
        Size of the sensor.
    """
    matters = {
        name: fraction
        for name, patch_series in series.items()
        if (fraction := _matters(patch_series, _area(regions[name], layout), frame)) > 0
    }
    if not matters:
        return ()
    largest = max(matters, key=lambda name: matters[name])
    return (
        f"the light of the rest of the frame may veil {', '.join(matters)}: a veiling glare of "
        f"{100 * USUAL_GLARE:.0f} %, as lenses have, would be up to {100 * matters[largest]:.2g} % "
        f"of {largest}'s signal; measure it with camera_calibration (black:), or photograph dim "
        "patches without bright ones",
    )


def _area(region: Region, layout: SensorLayout) -> float:
    """Return the part of the frame that a region covers."""
    _, _, width, height = region_pixels(region, layout.width, layout.height)
    return width * height / (layout.width * layout.height)


def _matters(series: Series, area: float, frame: Series) -> float:
    """Return a usual glare over the signal of a patch in the channel of most, 0 if no matter."""
    rows = series.usable & frame.usable & np.isfinite(series.sigma).all(axis=1)
    if not rows.any():
        return 0.0
    signal, sigma = series.values[rows], series.sigma[rows]
    veil = USUAL_GLARE * (frame.values[rows] - area * signal)
    weight = 1 / (np.square(sigma) + np.square(FLICKER * signal))
    power = (weight * np.square(signal)).sum(axis=0)
    # What is like the signal changes its level, the rest its course.
    levels = (weight * signal * veil).sum(axis=0) / power
    course_sigmas = np.sqrt((weight * np.square(veil - levels * signal)).sum())
    brightest = np.argmax((signal / sigma).sum(axis=0))
    if abs(levels[brightest]) < LEVEL and course_sigmas < COURSE_SIGMAS:
        return 0.0
    return float(np.abs(levels).max())
