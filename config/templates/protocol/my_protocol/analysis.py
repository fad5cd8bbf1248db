"""From the frames of a run to its result; nothing is drawn or printed here."""

import numpy as np

import labrig
from labrig.analyse import AnalysisContext
from labrig.results import Measured
from my_protocol.protocol import MyProtocolFrames
from my_protocol.result import MyProtocolResult


def analyse(context: AnalysisContext) -> MyProtocolResult:
    """Return the level of the glow over time, and the fraction of it that is left at the end."""
    frames = context.run.frames(MyProtocolFrames.GLOW)
    region = context.protocol.region
    green = [labrig.measure(labrig.read_raw(frame.path), region).channels["G"] for frame in frames]
    exposure_s = np.array([frame.exposure_s for frame in frames])
    level = np.array([channel.mean for channel in green]) / exposure_s
    sigma = np.array([channel.sigma for channel in green]) / exposure_s
    left = level[-1] / level[0]
    left_sigma = abs(left) * np.hypot(sigma[-1] / level[-1], sigma[0] / level[0])
    return MyProtocolResult(
        left=Measured(float(left), float(left_sigma), ""),
        time_s=np.array([frame.start_time - frames[0].start_time for frame in frames]),
        level_dn_per_s=level,
        sigma_dn_per_s=sigma,
    )
