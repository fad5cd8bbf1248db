"""Analysis of a check of colours: a ColorChecker plainly, and patch by patch through the LVF."""

from labrig.analyse.colour_check.analysis import analyse

__all__ = ["analyse"]
