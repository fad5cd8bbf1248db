"""The check that a calibrated bench is as it was."""
