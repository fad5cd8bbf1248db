"""Measurement of decays."""
