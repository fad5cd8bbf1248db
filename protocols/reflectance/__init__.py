"""Measurement of reflectance."""
