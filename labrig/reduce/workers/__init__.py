"""Reduction of many frames by processes that keep what they have reduced."""
