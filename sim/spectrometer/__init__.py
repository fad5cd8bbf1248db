"""A simulated USB2000+ in front of a white reference or a sample, as pyusb sees it."""

from .backend import SpectrometerBackend
from .instrument import Detector, UsbSpectrometer

__all__ = ["Detector", "SpectrometerBackend", "UsbSpectrometer"]
