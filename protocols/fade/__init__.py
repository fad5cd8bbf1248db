"""Measurement of the fade of a lamp."""
