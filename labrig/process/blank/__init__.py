"""From the frames of a blank to its blank file."""

from labrig.process.blank.stage import process

__all__ = ["process"]
