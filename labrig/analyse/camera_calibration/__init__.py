"""From the frames of a camera calibration to noise, linearity, settings and flat fields."""

from labrig.analyse.camera_calibration.analysis import analyse

__all__ = ["analyse"]
