"""The command line, with one module for each noun."""

from labrig.cli.exit_codes import guarded

__all__ = ["guarded"]
