"""The command line: thin, one file per noun."""

from labrig.cli.exit_codes import guarded

__all__ = ["guarded"]
