"""Measurement of the spectral curves of a camera."""
