"""Analysis of a directly measured re-radiation matrix."""

from labrig.analyse.direct_bispectral.analysis import analyse

__all__ = ["analyse"]
