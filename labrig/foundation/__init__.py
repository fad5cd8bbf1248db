"""Shared ground of all packages: errors, clock, numbers, models, files; it knows nothing of them.

Modules are imported by their own names.
"""
