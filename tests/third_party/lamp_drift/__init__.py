"""The drift of a lamp: driver, protocol, calibration, analysis and result in one package."""
