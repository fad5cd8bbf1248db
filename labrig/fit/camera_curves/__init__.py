"""Spectral sensitivities of an unknown camera, from a colour chart and the family of cameras."""

from labrig.fit.camera_curves.family import GRID_NM, CurveFamily, camera_family
from labrig.fit.camera_curves.fit import CameraCurvesFit, fit_camera_curves
from labrig.fit.camera_curves.readings import (
    ADDED,
    COURSE,
    COURSE_NM,
    LEVEL,
    ChartReadings,
    FilterReadings,
)

__all__ = [
    "ADDED",
    "COURSE",
    "COURSE_NM",
    "GRID_NM",
    "LEVEL",
    "CameraCurvesFit",
    "ChartReadings",
    "CurveFamily",
    "FilterReadings",
    "camera_family",
    "fit_camera_curves",
]
