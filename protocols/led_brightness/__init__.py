"""Measurement of the brightness of LEDs."""
