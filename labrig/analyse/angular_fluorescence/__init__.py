"""Analysis of an angular run: from its frames to whether re-radiation depends on angle."""

from labrig.analyse.angular_fluorescence.analysis import analyse

__all__ = ["analyse"]
