"""Processing of `saturation`: is r(0) = 1, and do rates depend on the charge."""

from labrig.analyse.saturation.process import process

__all__ = ["process"]
