"""From photographs of a lamp that fades and rises to its fade file."""

from labrig.process.fade.stage import process

__all__ = ["process"]
