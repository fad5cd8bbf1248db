"""The command line: thin, one file per noun."""

from labrig.cli.ending import guarded

__all__ = ["guarded"]
