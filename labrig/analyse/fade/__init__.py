"""From photographs of a switched lamp to its turn-off and turn-on transients by band."""

from labrig.analyse.fade.analysis import analyse

__all__ = ["analyse"]
