"""Spectra and what light passes on its way to a number."""

from labrig.optics.camera import CameraResponse, read_camera

__all__ = ["CameraResponse", "read_camera"]
