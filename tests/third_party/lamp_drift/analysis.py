"""The analysis: from the frames of a run to the drift of the lamp."""

import numpy as np

import labrig
from labrig.analyse import AnalysisContext
from labrig.results import Measured
from lamp_drift.calibration import DRIFT_KIND
from lamp_drift.protocol import DriftFrames
from lamp_drift.result import LampDriftResult


def analyse(context: AnalysisContext) -> LampDriftResult:
    """Fit a straight line to the light of the card, and compare its slope with the rig file's."""
    frames = context.run.frames(DriftFrames.CARD)
    green = [
        labrig.measure(labrig.read_raw(frame.path), context.protocol.region).channels["G"]
        for frame in frames
    ]
    time_s = np.array([frame.start_time - frames[0].start_time for frame in frames])
    exposure_s = np.array([frame.exposure_s for frame in frames])
    level_dn_per_s = np.array([channel.mean for channel in green]) / exposure_s
    relative = level_dn_per_s / level_dn_per_s.mean()
    (slope, _), covariance = np.polyfit(time_s, relative, 1, cov=True)
    drift = Measured(float(slope), float(np.sqrt(covariance[0, 0])), "1/s")
    change_sigmas = None
    earlier = context.inputs[DRIFT_KIND]
    if earlier is not None:
        sigma_per_s = np.hypot(drift.sigma, earlier.drift_per_s_sigma)
        change_sigmas = float((drift.value - earlier.drift_per_s) / sigma_per_s)
    return LampDriftResult(
        drift=drift, time_s=time_s, level_dn_per_s=level_dn_per_s, change_sigmas=change_sigmas
    )
