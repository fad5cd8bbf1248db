"""Analysis of a validation, from frames under lamps to measured and predicted colours."""

from labrig.analyse.validate_illuminants.analysis import analyse

__all__ = ["analyse"]
