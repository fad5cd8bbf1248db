"""A driver for labrig."""
