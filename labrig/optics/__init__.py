"""Spectra and what light passes on its way to a number."""

from labrig.optics.camera import CameraResponse, read_camera, shipped_cameras

__all__ = ["CameraResponse", "read_camera", "shipped_cameras"]
