from .calibration import (
    LvfCalibration as LvfCalibration,
    calibrate_lvf as calibrate_lvf,
    most_informative_filters as most_informative_filters,
)
from .card_pictures import (
    compare_card_pictures as compare_card_pictures,
    place_means as place_means,
)
from .lines import (
    MERCURY as MERCURY,
    Line as Line,
    WavelengthFit as WavelengthFit,
    fit_wavelengths as fit_wavelengths,
    locate_lines as locate_lines,
)
