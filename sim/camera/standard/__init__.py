"""The simulated camera as one that knows nothing but the PTP standard."""
