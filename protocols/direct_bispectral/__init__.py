"""Measurement of direct bispectral measurement."""
