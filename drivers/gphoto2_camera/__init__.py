"""Cameras of all makes through libgphoto2; needs the extra `labrig[gphoto2]`."""

from .camera import Gphoto2Camera

__all__ = ["Gphoto2Camera"]
