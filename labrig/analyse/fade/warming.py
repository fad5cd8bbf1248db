"""What a lamp lacks while its housing is cold, from photographs of a card after switching on."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.timed_frames import switched_time, timed, untimed
from labrig.calibration import CameraFile, Warming
from labrig.record import FrameRecord, RunRecord
from labrig.reduce import reduce_patches
from labrig.region import Region

FloatArray = NDArray[np.float64]

#: Time constants that a housing may have.
TAU_S: FloatArray = np.geomspace(15.0, 1500.0, 93)


def warming(
    run: RunRecord,
    frames: Sequence[FrameRecord],
    darks: Sequence[FrameRecord],
    card: Region,
    camera: CameraFile | None,
    flicker: float,
) -> tuple[Warming, FloatArray, FloatArray]:
    """What it lacks; and (n,) times since switching on with (n,) light over that of the warm lamp.

    The light is 1 − d e^(−t/τ) of that of the warm lamp, by the housing's Newtonian warming.
    """
    on = switched_time(run.completed()[frames[0].unit], frames[0], "on")
    series = reduce_patches(
        [timed(frame, on) for frame in frames],
        {"card": card},
        [untimed(frame) for frame in darks],
        camera=camera,
    )["card"]
    used = series.usable
    values, sigma = series.values[used], np.nan_to_num(series.sigma[used])
    best = int(np.argmax(np.mean(values, axis=0)))
    t_s, level = series.t_s[used], values[:, best]
    unsure = np.hypot(sigma[:, best], flicker * level)
    found = [_fit(t_s, level / unsure, 1 / unsure, tau) for tau in TAU_S]
    chi2 = np.array([one[2] for one in found])
    weight = np.exp(-(chi2 - chi2.min()) / 2)
    weight /= weight.sum()
    lacks = np.array([one[0] for one in found])
    own = np.array([one[1] for one in found])
    mean = float(weight @ lacks)
    spread = float(np.sqrt(weight @ (own**2 + (lacks - mean) ** 2)))
    at = int(np.argmin(chi2))
    file = Warming(lacks=max(mean, 0.0), lacks_sigma=spread, warms_s=float(TAU_S[at]))
    return file, t_s, level / found[at][3]


def _fit(
    t_s: FloatArray, level: FloatArray, one: FloatArray, tau_s: float
) -> tuple[float, float, float, float]:
    """What is lacking and its σ, χ², the warm lamp's level; values already over their σ."""
    rows = np.stack([one, -one * np.exp(-t_s / tau_s)], axis=1)
    covariance = np.linalg.inv(rows.T @ rows)
    warm, less = covariance @ (rows.T @ level)
    lacks = less / warm
    slope = np.array([-lacks, 1.0]) / warm
    left = level - rows @ [warm, less]
    sigma = float(np.sqrt(slope @ covariance @ slope))
    return float(lacks), sigma, float(left @ left), float(warm)
