"""Irradiance of the lamp on the sample, by itself and through the LVF."""

from labrig.analyse.irradiance.stage import process

__all__ = ["process"]
