"""The family of measured cameras: mean of their curves, and how cameras differ.

Jiang et al. describe a channel by its mean and a few principal components. Here all components are
kept, each weighed by its variance, and channels vary together, since lens and infrared filter are
common to them. What some tens of cameras cannot show is added as a smooth random difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse

#: Wavelengths in nm of estimated curves.
GRID_NM: FloatArray = np.arange(380.0, 781.0, 5.0)
#: Part of the variance between cameras that is a smooth difference of no other camera, and the
#: distance in nm at which it is independent. Both were chosen by leaving out each shipped camera.
OWN_SHARE, OWN_NM = 0.08, 12.0
#: Relative prior σ of the scale of each channel, which the chart's own greys tell better.
SCALE_SIGMA = 0.1
#: Fewest cameras that tell how cameras differ.
FEWEST = 8


@dataclass(frozen=True, eq=False)
class CurveFamily:
    """Normal density of the curves of cameras, each channel scaled by its response to a grey.

    Attributes
    ----------
    mean
        Mean curves on `GRID_NM`, shape (k, n).
    covariance
        Covariance of all k · n values, channel by channel.
    count
        Number of cameras.
    """

    mean: FloatArray
    covariance: FloatArray
    count: int


def camera_family(cameras: Sequence[CameraResponse], grey_light: FloatArray) -> CurveFamily:
    """Return mean and covariance of the curves of some cameras.

    Parameters
    ----------
    cameras
        Measured cameras of the same channels.
    grey_light
        Light of a grey surface per cell of `GRID_NM`, to which every channel responds by 1, (n,).

    Raises
    ------
    ValueError
        There are too few cameras.
    """
    if len(cameras) < FEWEST:
        raise ValueError(f"expected {FEWEST} or more cameras, got {len(cameras)}")
    curves = np.stack([camera.at(GRID_NM).T for camera in cameras]).clip(0.0)
    curves = curves / (curves @ grey_light)[:, :, np.newaxis]
    mean = curves.mean(axis=0)
    differences = (curves - mean).reshape(len(cameras), -1)
    between = differences.T @ differences / (len(cameras) - 1)
    sigma = np.sqrt(np.diag(between))
    smooth = np.kron(np.eye(len(mean)), correlation(OWN_NM))
    own = sigma[:, np.newaxis] * smooth * sigma
    covariance = (1 - OWN_SHARE) * between + OWN_SHARE * own
    for channel in range(len(mean)):
        scaled = np.zeros_like(mean)
        scaled[channel] = SCALE_SIGMA * mean[channel]
        covariance += np.outer(scaled, scaled)
    return CurveFamily(mean, covariance, len(cameras))


def correlation(distance_nm: float) -> FloatArray:
    """Return the correlation (n, n) on `GRID_NM` of a smooth random function."""
    off = (GRID_NM[:, np.newaxis] - GRID_NM) / distance_nm
    return np.asarray(np.exp(-(off**2) / 2))
