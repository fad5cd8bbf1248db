"""Veiling glare: light of the whole frame that the lens scatters evenly over all of it."""

from dataclasses import replace

import numpy as np

from labrig.optics import Glare
from labrig.region import Region
from labrig.results import Series

#: The frame as a region, and its name among the patches of a sample.
WHOLE_FRAME: Region = (0.0, 0.0, 1.0, 1.0)
WHOLE_FRAME_NAME = "(whole frame)"


def subtract_glare(series: Series, frame: Series, glare: Glare) -> Series:
    """Return the series of a patch without the frame's veiling glare.

    A lens that scatters the fraction g of the light shows (1 − g) x + g m of a patch of signal x in
    a frame of mean m, and m of that mean itself.

    Parameters
    ----------
    series, frame
        Series of the patch and of the whole frame, both with the vignetting divided out.
    glare
        Glare of the lens. Its σ counts as an error of the dark level: it is common to all frames.
    """
    veil = glare.fraction * frame.values
    passed = 1 - glare.fraction
    weights = 1 / np.square(series.sigma)
    veil_sigma = np.average(glare.sigma * np.abs(frame.values), axis=0, weights=weights)
    return replace(
        series,
        values=(series.values - veil) / passed,
        sigma=series.sigma / passed,
        dark_sigma=np.hypot(series.dark_sigma, veil_sigma) / passed,
    )
