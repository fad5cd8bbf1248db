"""Measurement of saturation."""
