"""Measurement of the irradiance on a sample."""
