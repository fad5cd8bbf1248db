from .assumptions import Sources as Sources
from .patch import PatchPrediction as PatchPrediction
from .prediction import (
    Prediction as Prediction,
    Remedy as Remedy,
    predict as predict,
)
