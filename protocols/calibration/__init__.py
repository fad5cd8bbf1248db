"""Measurement of a bench's calibration, as a chain."""
