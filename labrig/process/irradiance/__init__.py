"""Irradiance of the lamp on the sample, by itself and through the LVF."""

from labrig.process.irradiance.stage import process

__all__ = ["process"]
