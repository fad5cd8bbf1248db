"""From the frames of a camera calibration to its camera file."""

from labrig.analyse.camera_calibration.stage import process

__all__ = ["process"]
