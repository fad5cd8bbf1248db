"""Measurement of predictions under other lamps."""
