from .estimate import (
    JointEstimator as JointEstimator,
    fit_fluorescence as fit_fluorescence,
)
from .led_sets import (
    RECOMMENDED_NM as RECOMMENDED_NM,
    LedSet as LedSet,
    LedStudy as LedStudy,
    even_peaks_nm as even_peaks_nm,
    gaussian_led as gaussian_led,
    moved_leds as moved_leds,
    require_peaks as require_peaks,
    study_leds as study_leds,
    study_set as study_set,
    usual_led as usual_led,
)
from .per_led import fit_per_led as fit_per_led
from .result import (
    EstimatedFluorophore as EstimatedFluorophore,
    EstimateFact as EstimateFact,
    ExtrapolatedExcitation as ExtrapolatedExcitation,
    FluorescenceFit as FluorescenceFit,
    FluorophoreNumber as FluorophoreNumber,
    Method as Method,
    MoreThanWhite as MoreThanWhite,
    PredictedColour as PredictedColour,
    Surfaces as Surfaces,
    UnexplainedValues as UnexplainedValues,
    UnknownBrightness as UnknownBrightness,
    predicted_colour as predicted_colour,
)
from .system import (
    Exposure as Exposure,
    FluorescenceSystem as FluorescenceSystem,
    fluorescence_system as fluorescence_system,
)
