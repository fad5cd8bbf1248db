"""Meshes from files of other programs, whose numbers are held against what the files state."""
