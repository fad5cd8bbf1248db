"""Measurement of the calibration of a camera."""
