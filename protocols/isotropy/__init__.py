"""Measurement of the isotropy of a glow."""
