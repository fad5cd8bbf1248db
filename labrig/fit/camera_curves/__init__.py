"""Spectral sensitivities of an unknown camera, from a colour chart and the family of cameras."""

from labrig.fit.camera_curves.family import GRID_NM, CurveFamily, camera_family
from labrig.fit.camera_curves.fit import CameraCurvesFit, fit_camera_curves
from labrig.fit.camera_curves.readings import ChartReadings, FilterReadings

__all__ = [
    "GRID_NM",
    "CameraCurvesFit",
    "ChartReadings",
    "CurveFamily",
    "FilterReadings",
    "camera_family",
    "fit_camera_curves",
]
