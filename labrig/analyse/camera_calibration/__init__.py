"""From the frames of a camera calibration to what body and lens make of light."""

from labrig.analyse.camera_calibration.analysis import analyse

__all__ = ["analyse"]
