"""Values of every position of a strip, scene by scene, from all frames of a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.lvf_calibration.picture import FloatArray
from labrig.calibration import CameraFile
from labrig.calibration.lvf_file import Strip
from labrig.reduce import SeriesFrame, reduce_patches

#: Lamp, shutter and aperture from one scene to the next, relative; all colours and places alike.
FLICKER = 0.005
#: Relative errors that no two frames share: the sensor's pattern, dust.
PATTERN = 0.002


@dataclass(frozen=True, eq=False)
class SliceValues:
    """DN/s along a strip.

    Attributes
    ----------
    value, sigma
        (positions, channels); NaN where all frames clip. σ is without `FLICKER`, which is common
        to all places and channels.
    """

    value: FloatArray
    sigma: FloatArray


def slice_values(
    frames: Sequence[SeriesFrame],
    strip: Strip,
    darks: Sequence[SeriesFrame],
    camera: CameraFile | None,
) -> Mapping[str, SliceValues]:
    """By the unit of the frames; those of one unit show one scene at several exposures."""
    series = reduce_patches(frames, strip.slices(), darks, camera=camera)
    units = dict.fromkeys(frame.unit for frame in frames)
    found = {}
    for unit in units:
        pairs = []
        for one in series.values():
            rows = np.array(one.unit) == unit
            usable = rows & one.usable & np.isfinite(one.sigma).all(axis=1)
            pairs.append(_mean(one.values[usable], one.sigma[usable], one.dark_sigma))
        value, sigma = np.moveaxis(np.array(pairs), 1, 0)
        found[unit] = SliceValues(value, sigma)
    return found


def _mean(
    value: FloatArray, sigma: FloatArray, dark_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(channels,) of the frames (n, channels) of one scene, weighted."""
    if not len(value):
        return np.full_like(dark_sigma, np.nan), np.full_like(dark_sigma, np.nan)
    weight = 1 / sigma**2
    mean = (weight * value).sum(axis=0) / weight.sum(axis=0)
    dark = np.nan_to_num(dark_sigma)
    return mean, np.sqrt(1 / weight.sum(axis=0) + dark**2 + (PATTERN * mean) ** 2)
