"""Calibration of a linear variable filter: mercury lines, and colour filters over a grey card."""

from labrig.fit.lvf.calibration import LvfCalibration, calibrate_lvf, most_informative_filters
from labrig.fit.lvf.card_pictures import compare_card_pictures, place_means
from labrig.fit.lvf.lines import MERCURY, Line, WavelengthFit, fit_wavelengths, locate_lines

__all__ = [
    "MERCURY",
    "Line",
    "LvfCalibration",
    "WavelengthFit",
    "calibrate_lvf",
    "compare_card_pictures",
    "fit_wavelengths",
    "locate_lines",
    "most_informative_filters",
    "place_means",
]
