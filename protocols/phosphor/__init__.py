"""Measurement of a phosphor, as a chain."""
