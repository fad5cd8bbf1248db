"""From photographs of a lit card to how the lamp drifts."""

import numpy as np

import labrig
from labrig.analyse import Part
from labrig.results import Measured
from lamp_drift.result import LampDriftResult


def analyse(part: Part) -> LampDriftResult:
    """A straight line through the light of the photographs."""
    frames = part.run.frames("lit")
    green = [
        labrig.measure(labrig.read_raw(frame.path), part.protocol.region).channels["G"]
        for frame in frames
    ]
    time_s = np.array([frame.start_time - frames[0].start_time for frame in frames])
    level = np.array([one.mean for one in green]) / [frame.exposure_s for frame in frames]
    (slope, _), covariance = np.polyfit(time_s, level / level.mean(), 1, cov=True)
    return LampDriftResult(
        drift=Measured(float(slope), float(np.sqrt(covariance[0, 0])), "1/s"),
        time_s=time_s,
        level_dn_per_s=level,
    )
