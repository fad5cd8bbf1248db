"""A simulated USB2000+ in front of a white reference or a sample, as pyusb sees it."""

from .backend import SpectrometerBackend
from .detector import Detector
from .instrument import UsbSpectrometer

__all__ = ["Detector", "SpectrometerBackend", "UsbSpectrometer"]
