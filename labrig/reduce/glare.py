"""Veiling glare: light of the whole frame that the lens scatters evenly over all of it."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from labrig.foundation.region import Region
from labrig.optics import Glare
from labrig.results import Series

#: The frame as a region, and its name among the patches of a sample.
WHOLE_FRAME: Region = (0.0, 0.0, 1.0, 1.0)
WHOLE_FRAME_NAME = "(whole frame)"


#: Tiles of the frame, across and down. The vignetting is divided out in each: bright samples
#: may lie where it is least, or most.
TILES = 8
FRAME_TILES: dict[str, Region] = {
    f"(tile {down + 1}.{across + 1})": (across / TILES, down / TILES, 1 / TILES, 1 / TILES)
    for down, across in product(range(TILES), repeat=2)
}


def frame_series(tiles: Sequence[Series]) -> Series:
    """Return the series of the whole frame, the mean of its tiles.

    Parameters
    ----------
    tiles
        Series of `FRAME_TILES`, each with the vignetting of its own divided out.

    Returns
    -------
    Series
        Mean light of each frame in the unit of the tiles.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import labrig
    >>> from labrig.reduce import frame_series
    >>> series = labrig.read_series("series.csv")[0]
    >>> frame = frame_series([series, replace(series, values=3 * series.values)])
    >>> bool((frame.values == 2 * series.values).all())
    True
    """
    return replace(
        tiles[0],
        values=np.mean([tile.values for tile in tiles], axis=0),
        sigma=np.sqrt(np.mean([tile.sigma**2 for tile in tiles], axis=0) / len(tiles)),
        dark_sigma=np.mean([tile.dark_sigma for tile in tiles], axis=0),
        region=WHOLE_FRAME_NAME,
    )


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
