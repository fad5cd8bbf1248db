"""Re-radiation matrices from photographs under narrow-band lights.

One light after the other, and an RGB camera, after P. McEvoy, *Capture and simulation of
fluorescence in fabrics* (Chalmers, 2020), called the thesis here.
"""

from labrig.fit.fluorescence.estimate import JointEstimator, fit_fluorescence
from labrig.fit.fluorescence.led_sets import (
    RECOMMENDED_NM,
    LedSet,
    LedStudy,
    even_peaks_nm,
    gaussian_led,
    moved_leds,
    require_peaks,
    study_leds,
    study_set,
    usual_led,
)
from labrig.fit.fluorescence.per_led import fit_per_led
from labrig.fit.fluorescence.result import (
    EstimatedFluorophore,
    EstimateFact,
    ExtrapolatedExcitation,
    FluorescenceFit,
    FluorophoreNumber,
    Method,
    MoreThanWhite,
    PredictedColour,
    Surfaces,
    UnexplainedValues,
    UnknownBrightness,
    predicted_colour,
)
from labrig.fit.fluorescence.system import Exposure, FluorescenceSystem, fluorescence_system

__all__ = [
    "RECOMMENDED_NM",
    "EstimateFact",
    "EstimatedFluorophore",
    "Exposure",
    "ExtrapolatedExcitation",
    "FluorescenceFit",
    "FluorescenceSystem",
    "FluorophoreNumber",
    "JointEstimator",
    "LedSet",
    "LedStudy",
    "Method",
    "MoreThanWhite",
    "PredictedColour",
    "Surfaces",
    "UnexplainedValues",
    "UnknownBrightness",
    "even_peaks_nm",
    "fit_fluorescence",
    "fit_per_led",
    "fluorescence_system",
    "gaussian_led",
    "moved_leds",
    "predicted_colour",
    "require_peaks",
    "study_leds",
    "study_set",
    "usual_led",
]
