"""From photographs of a lamp that fades and rises to its fade file."""

from labrig.analyse.fade.stage import process

__all__ = ["process"]
