"""Measurement of luminance."""
