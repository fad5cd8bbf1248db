"""The simulated camera as one that implements nothing but the PTP standard."""
