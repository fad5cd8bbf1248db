"""Measurement of stray light of a blank."""
