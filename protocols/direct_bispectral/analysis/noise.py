"""Noise of a spectrometer's readings, from the scatter of their repetitions.

A pixel's own scatter over a few repetitions says little, but the noise of all pixels of all
readings of a run follows one law: read noise, dark current, and shot noise of the light. What all
pixels of a repetition share is the noise of the dark pixels, which are subtracted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.optics import SpectrometerReading

#: Groups of pixels with similar light in a reading, whose variances are averaged.
GROUPS = 24
ITERATIONS = 3
#: Part of the pixels of a reading with the least light, whose mean shows the common noise.
DIM_PART = 0.25


@dataclass(frozen=True)
class ReadingNoise:
    """Variances of one repetition, in counts².

    Attributes
    ----------
    read
        Variance of a pixel without light.
    dark_per_s
        What dark current adds in a second.
    gain
        Variance per count of light.
    common
        Variance of the offset that all pixels share.
    """

    read: float
    dark_per_s: float
    gain: float
    common: float

    def variance(self, counts: FloatArray, integration_s: float) -> FloatArray:
        """Return the variance of pixels with these counts of light."""
        return self.read + self.dark_per_s * integration_s + self.gain * np.maximum(counts, 0.0)


def repetitions(reading: SpectrometerReading) -> FloatArray:
    """Return the linear counts of each repetition, shape (repetitions, pixels)."""
    return np.array(
        [
            replace(reading, raw_counts=counts[np.newaxis]).corrected().counts
            for counts in reading.raw_counts
        ]
    )


def reading_noise(readings: Sequence[SpectrometerReading]) -> ReadingNoise:
    """Return the noise of an instrument by all readings of a run, two repetitions or more each."""
    rows, variances, common, weights = [], [], [], []
    for reading in readings:
        linear = repetitions(reading)
        usable = ~reading.saturated
        usable[list(reading.dark_pixels)] = False
        counts, scatter = linear.mean(axis=0)[usable], linear.var(axis=0, ddof=1)[usable]
        order = np.argsort(counts)
        for group in np.array_split(order, GROUPS):
            rows.append((1.0, reading.integration_s, max(float(counts[group].mean()), 0.0)))
            variances.append(float(scatter[group].mean()))
        dim = order[: max(int(DIM_PART * len(order)), 1)]
        together = linear[:, usable][:, dim].mean(axis=1).var(ddof=1)
        common.append(together - scatter[dim].mean() / len(dim))
        weights.append(len(linear) - 1)
    design, target = np.array(rows), np.array(variances)
    law = np.array([float(np.median(target)), 0.0, 0.0])
    for _ in range(ITERATIONS):
        # The scatter of a variance is proportional to it.
        sigma = np.maximum(design @ law, 1e-12)
        law = nonnegative_least_squares(design / sigma[:, np.newaxis], target / sigma)
    shared = float(np.average(common, weights=weights))
    read, dark_per_s, gain = law.tolist()
    return ReadingNoise(read, dark_per_s, gain, max(shared, 0.0))
