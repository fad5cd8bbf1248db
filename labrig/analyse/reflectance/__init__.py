"""From frames of card, lit sample and glow to albedo and total radiance factor."""

from labrig.analyse.reflectance.analysis import analyse

__all__ = ["analyse"]
