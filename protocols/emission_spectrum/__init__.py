"""Measurement of emission spectra."""
