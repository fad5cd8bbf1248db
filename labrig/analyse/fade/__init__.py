"""From photographs of a lamp that fades and rises to how it does so, band by band."""

from labrig.analyse.fade.analysis import analyse

__all__ = ["analyse"]
