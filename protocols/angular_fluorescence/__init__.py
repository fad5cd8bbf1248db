"""Measurement of fluorescence by the angle of view."""
