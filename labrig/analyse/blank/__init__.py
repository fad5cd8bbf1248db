"""From the frames of a blank to what light there is where nothing glows."""

from labrig.analyse.blank.analysis import analyse

__all__ = ["analyse"]
