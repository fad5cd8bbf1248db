"""Measurement of excitation."""
