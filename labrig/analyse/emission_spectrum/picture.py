"""What the LVF's positions showed, frame by frame, and several frames as one picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.errors import DataError

FloatArray = NDArray[np.float64]

#: Rounds in which brightness and picture follow each other; each gains a digit or more.
ROUNDS = 20
#: All of the light together is so many σ at least.
SEEN_SIGMA = 5.0


@dataclass(frozen=True, eq=False)
class Pictures:
    """Frames of one scene, whose brightness may change and whose colours may not.

    Attributes
    ----------
    t_s
        (f,) middle of each exposure after lamp off.
    value, sigma
        (f, m) DN/s at every position and channel, NaN where it clips; one standard deviation of
        what is independent.
    dark_sigma
        (f, m) of what a dark level that is off adds to all values of a frame together.
    """

    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    dark_sigma: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    def take(self, rows: Sequence[int]) -> "Pictures":
        """Some of the frames."""
        chosen = list(rows)
        return Pictures(
            self.t_s[chosen], self.value[chosen], self.sigma[chosen], self.dark_sigma[chosen]
        )


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture out of several frames: (m,) values as bright as the first frame, and σ.

    Attributes
    ----------
    brightness
        (f,) of every frame relative to the first.
    """

    value: FloatArray
    sigma: FloatArray
    brightness: FloatArray

    @property
    def shows_light(self) -> bool:
        """Whether all of it together stands out of the noise."""
        return bool(np.nansum(self.value) > SEEN_SIGMA * np.sqrt(np.nansum(self.sigma**2)))


def combined(frames: Pictures) -> Picture:
    """The picture behind some frames, each as bright as it is."""
    weight = np.nan_to_num(1 / (frames.sigma**2 + frames.dark_sigma**2))
    value = np.nan_to_num(frames.value)
    brightness = np.ones(len(frames))
    for _ in range(ROUNDS):
        total = (weight * brightness[:, np.newaxis] ** 2).sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = (weight * value * brightness[:, np.newaxis]).sum(axis=0) / total
        known = np.nan_to_num(mean)
        brightness = (weight * value) @ known / (weight @ known**2)
        brightness = brightness / (brightness[0] or 1.0)
    with np.errstate(divide="ignore"):
        sigma = np.where(total > 0, 1 / np.sqrt(total), np.nan)
    return Picture(mean, sigma, brightness)


def visible(frames: Pictures) -> Pictures:
    """Those of the frames in which there is light.

    Raises
    ------
    DataError
        There is none in any of them.
    """
    rows = [row for row in range(len(frames)) if combined(frames.take([row])).shows_light]
    if not rows:
        raise DataError(
            "expected light through the LVF, got none above the noise: was the sample charged, is "
            "the filter where it was calibrated? (raise camera.iso, expose longer)"
        )
    return frames.take(rows)
