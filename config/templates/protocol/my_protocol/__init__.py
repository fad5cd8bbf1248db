"""A protocol for labrig: what is done, what is analysed, and the result."""
