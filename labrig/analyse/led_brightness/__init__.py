"""Spectrum and brightness of every LED, from frames and spectra of a white reference."""

from labrig.analyse.led_brightness.analysis import analyse

__all__ = ["analyse"]
