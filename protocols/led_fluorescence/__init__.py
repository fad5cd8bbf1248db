"""Measurement of fluorescence under LEDs."""
