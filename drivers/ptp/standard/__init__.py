"""Cameras without a maker's extension: the abilities of PIMA 15740 itself."""
