"""Cameras without a maker's extension: what PIMA 15740 itself offers, and no more."""
