"""Prediction of a protocol's uncertainties, and of changes that would halve them."""

from labrig.predict.assumptions import Sources
from labrig.predict.patch import PatchPrediction
from labrig.predict.prediction import Prediction, Remedy, predict

__all__ = ["PatchPrediction", "Prediction", "Remedy", "Sources", "predict"]
