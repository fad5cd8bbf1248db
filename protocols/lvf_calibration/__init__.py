"""Measurement of the calibration of the variable filter."""
